// The host's side of the protocol: parses bytes into lines.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct answer {
    char letter;
    uint32_t first, second;
};

// Reads one line, without its line feed. False if it is not an answer: truncated, garbled, or empty.
bool answer_parse(const char *line, struct answer *answer);
