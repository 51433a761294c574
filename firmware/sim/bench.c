#include "bench.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void widen(struct range *range, double value) {
    if (value < range->least) range->least = value;
    if (value > range->most) range->most = value;
}

struct board board;
struct seen seen;
int failures;

static char line[64];
static size_t line_length;

void forget(void) {
    const avr_cycle_count_t rise = seen.rise; // of a pulse under way
    memset(&seen, 0, sizeof seen);
    seen.rise = rise;
    seen.latency_cycles = seen.length_us = NOTHING;
}

static void pins_changed(struct board *b, uint8_t before, uint8_t after) {
    if (before == IDLE && after == RAISED) {
        seen.pulses++;
        seen.rise = b->avr->cycle;
        const double latency_cycles = seen.rise - b->received;
        if (latency_cycles < seen.latency_cycles.least) seen.soonest = 0;
        widen(&seen.latency_cycles, latency_cycles);
        seen.soonest += latency_cycles == seen.latency_cycles.least;
    } else if (before == RAISED && after == IDLE) {
        seen.fall = b->avr->cycle;
        widen(&seen.length_us, (double)(seen.fall - seen.rise) / MHZ);
    } else {
        seen.torn++;
    }
}

static void byte_sent(struct board *b, uint8_t byte) {
    (void)b;
    if (byte != '\n') {
        if (line_length < sizeof line - 1) line[line_length++] = byte;
        return;
    }
    line[line_length] = 0;
    if (line_length && seen.answered < MAX_ANSWERS)
        answer_parse(line, &seen.answers[seen.answered]) ? seen.answered++ : seen.garbled++;
    line_length = 0;
}

void request(const char *bytes) {
    for (; *bytes; bytes++)
        if (!board_send(&board, &(uint16_t){*bytes}, 1)) printf("FAIL the wire is full\n"), exit(1);
}

void run(avr_cycle_count_t cycles) {
    if (!board_run(&board, cycles)) printf("FAIL the processor stopped\n"), exit(1);
}

uint64_t total(char letter) {
    uint64_t sum = 0;
    for (size_t i = 0; i < seen.answered; i++)
        if (seen.answers[i].letter == letter) sum += seen.answers[i].first;
    return sum;
}

size_t lines(char letter) {
    size_t count = 0;
    for (size_t i = 0; i < seen.answered; i++) count += seen.answers[i].letter == letter;
    return count;
}

struct answer last(void) {
    return seen.answered ? seen.answers[seen.answered - 1] : (struct answer){0};
}

bool only(char letter, uint32_t first, uint32_t second) {
    const struct answer *a = seen.answers;
    return seen.answered == 1 && !seen.garbled && a->letter == letter && a->first == first && a->second == second;
}

void verdict(bool good, const char *name, const char *format, ...) {
    va_list values;
    va_start(values, format);
    printf("%s %-22s ", good ? "ok  " : "FAIL", name);
    vprintf(format, values);
    putchar('\n');
    va_end(values);
    failures += !good;
}

bool bench_open(const char *hex) {
    board.on_pins = pins_changed;
    board.on_sent = byte_sent;
    return board_open(&board, hex);
}
