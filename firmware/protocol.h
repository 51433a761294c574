// Protocol between the trigger controller and its host. Its meaning is in README.md, "Protocol".
#pragma once

#define PROTOCOL_VERSION 1
#define BAUD 500000UL // exact from 16 MHz, a standard rate of Linux, exact in the usual USB converters

// Requests: one byte each; a length is 'L', digits, then CR or LF.
#define REQUEST_PULSE 'T'
#define REQUEST_STATUS 'S'
#define REQUEST_LENGTH 'L'

// Answers: "<letter> <number> <number> <crc>\n", numbers decimal, crc two hexadecimal digits.
#define ANSWER_PULSE 'P'
#define ANSWER_LENGTH 'L'
#define ANSWER_STATUS 'S'
#define ANSWER_BUSY 'B'
#define ANSWER_OVERRUN 'O'
#define ANSWER_FRAMING 'F'
#define ANSWER_UNKNOWN 'U'
#define ANSWER_RESET 'R'

// Pulse lengths, microseconds.
#define LENGTH_DEFAULT_US 20000UL
#define LENGTH_MIN_US 100UL
#define LENGTH_MAX_US 1000000UL
