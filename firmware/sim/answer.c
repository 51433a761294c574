#include "answer.h"

#include <stdio.h>
#include <string.h>

static uint8_t crc8(const char *bytes, size_t count) {
    uint8_t crc = 0;
    for (size_t i = 0; i < count; i++) {
        crc ^= (uint8_t)bytes[i];
        for (int bit = 0; bit < 8; bit++) crc = crc & 0x80 ? crc << 1 ^ 0x07 : crc << 1;
    }
    return crc;
}

bool answer_parse(const char *line, struct answer *answer) {
    const char *last_space = strrchr(line, ' ');
    unsigned crc;
    int end = 0;
    return last_space &&
           sscanf(line, "%c %u %u %2x%n", &answer->letter, &answer->first, &answer->second, &crc, &end) == 4 &&
           line[end] == 0 && crc == crc8(line, last_space - line);
}
