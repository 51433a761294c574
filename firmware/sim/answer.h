// The host's side of the protocol: lines out of bytes.
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

struct answer {
    char letter;
    uint32_t first, second;
};

// Reads one line, without its line feed. False where it is none: cut off, garbled, or empty.
bool answer_parse(const char *line, struct answer *answer);
