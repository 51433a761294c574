// An Arduino Uno in simavr: the ATmega328P runs the firmware, and this is its surroundings, exact to the cycle.
//
// Three simplifications of simavr 1.6 are corrected here, because the measurements depend on them: a frame is ten bits
// (simavr counts a parity bit that is not there); the receiver holds two bytes and a third in its shift register, and a
// fourth overruns it (simavr holds 64); and entering an interrupt costs four cycles, eight out of sleep (simavr: none;
// data sheet, 7.7.1 "Interrupt Response Time").
#pragma once

#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_io.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "../protocol.h"

enum { MHZ = 16, FRAME_BITS = 10, FRAME_CYCLES = FRAME_BITS * MHZ * 1000000 / BAUD, WIRE_BYTES = 1 << 16 };

// Levels of the Uno's pins D8, D9 and D13. A pin that is not an output follows the resistor of the wiring.
enum { LOW_LINE = 1 << 0, HIGH_LINE = 1 << 1, LED = 1 << 5, PINS = LOW_LINE | HIGH_LINE | LED };
enum { IDLE = LOW_LINE, RAISED = HIGH_LINE | LED };

// A frame whose stop bit is missing, for board_send.
enum { BROKEN = UART_INPUT_FE };

struct board {
    avr_io_t io; // first: hears of resets
    avr_t *avr;
    avr_uart_t *uart;

    uint16_t wire[WIRE_BYTES]; // frames on their way to the chip
    size_t wire_head, wire_tail;
    avr_cycle_count_t received; // when the last frame was complete

    uint8_t pins;
    unsigned resets;
    bool hung; // fault: the program counter stands still, interrupts are off
    bool deaf; // fault: interrupts are off, the main loop runs

    void *user;
    void (*on_pins)(struct board *, uint8_t before, uint8_t after); // at avr->cycle
    void (*on_sent)(struct board *, uint8_t byte);                  // by the chip
    avr_cycle_count_t (*on_tick)(struct board *);                   // cycles to the next tick; also after a reset
};

// Powers the board up with the program of an Intel hex file, its UART and timer as a bootloader may leave them. False,
// with a line on stderr, if that cannot be read.
bool board_open(struct board *board, const char *hex);

// Puts frames on the wire to the chip, back to back after those already on it. False if the wire has no room.
bool board_send(struct board *board, const uint16_t *frames, size_t count);

// Same as the reset pin.
void board_reset(struct board *board);

// Baud rate to which the chip's UART is set.
double board_baud(const struct board *board);

bool board_wire_is_quiet(const struct board *board);

// Runs one instruction, or a sleep to the next event. False if the processor has stopped for good.
bool board_step(struct board *board);

// Steps until `cycles` from now have passed.
bool board_run(struct board *board, avr_cycle_count_t cycles);
