// A board on the bench: requests in, and the observed state of its pins and its line.
#pragma once

#include "answer.h"
#include "board.h"

enum { MAX_ANSWERS = 1 << 17 };
#define US(us) ((avr_cycle_count_t)(us) * MHZ)

struct range {
    double least, most;
};
#define NOTHING ((struct range){1e300, -1e300})
void widen(struct range *range, double value);

extern struct board board;
extern int failures;

// Since `forget`.
extern struct seen {
    unsigned pulses, torn; // torn: the pins did not change together
    avr_cycle_count_t rise, fall;
    struct range latency_cycles, length_us;
    unsigned soonest; // pulses of the least latency
    struct answer answers[MAX_ANSWERS];
    size_t answered;
    unsigned garbled;
} seen;

bool bench_open(const char *hex);
void forget(void);
void request(const char *bytes);
void run(avr_cycle_count_t cycles);

// Number of answers with this letter, and the sum of their first numbers.
size_t lines(char letter);
uint64_t total(char letter);

// The last answer; all zero if there is none.
struct answer last(void);

// True if this was the only answer.
bool only(char letter, uint32_t first, uint32_t second);

__attribute__((format(printf, 3, 4))) void verdict(bool good, const char *name, const char *format, ...);
