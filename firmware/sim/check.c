// Measures the firmware on the pins of the simulated board, to the cycle. Usage: check FILE.hex
#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "answer.h"
#include "board.h"

enum { MAX_ANSWERS = 1 << 17, POWER_ON = 1, WATCHDOG = 8 };
enum { LAP_CYCLES = 0x10000 * 8, LAP_US = LAP_CYCLES / MHZ };
#define US(us) ((avr_cycle_count_t)(us) * MHZ)

struct range {
    double least, most;
};
static const struct range NOTHING = {1e300, -1e300};

static void widen(struct range *range, double value) {
    if (value < range->least) range->least = value;
    if (value > range->most) range->most = value;
}

// What the pins and the line have shown since `forget`.
static struct {
    unsigned pulses, torn; // torn: the lines did not change together
    avr_cycle_count_t rise, fall;
    struct range latency_cycles, length_us;
    unsigned soonest; // pulses of the least latency
    struct answer answers[MAX_ANSWERS];
    size_t answered;
    unsigned garbled;
} seen;

static struct board board;
static char line[64];
static size_t line_length;
static int failures;

static void forget(void) {
    memset(&seen, 0, sizeof seen);
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

static void send(const char *bytes) {
    for (; *bytes; bytes++) board_send(&board, &(uint16_t){*bytes}, 1);
}

static void run(avr_cycle_count_t cycles) {
    if (!board_run(&board, cycles)) printf("FAIL the processor stopped\n"), exit(1);
}

static uint64_t total(char letter) {
    uint64_t sum = 0;
    for (size_t i = 0; i < seen.answered; i++)
        if (seen.answers[i].letter == letter) sum += seen.answers[i].first;
    return sum;
}

static size_t lines(char letter) {
    size_t count = 0;
    for (size_t i = 0; i < seen.answered; i++) count += seen.answers[i].letter == letter;
    return count;
}

// Whether the answers since `forget` were this one alone.
static bool only(char letter, uint32_t first, uint32_t second) {
    const struct answer *a = seen.answers;
    return seen.answered == 1 && !seen.garbled && a->letter == letter && a->first == first && a->second == second;
}

__attribute__((format(printf, 3, 4))) static void verdict(bool good, const char *name, const char *format, ...) {
    va_list values;
    va_start(values, format);
    printf("%s %-22s ", good ? "ok  " : "FAIL", name);
    vprintf(format, values);
    putchar('\n');
    va_end(values);
    failures += !good;
}

static void power_on(void) {
    forget();
    run(US(2000));
    verdict(only(ANSWER_RESET, POWER_ON, PROTOCOL_VERSION) && !seen.pulses && !seen.torn && board_baud(&board) == BAUD,
            "power on", "says R once, the lines stay idle, %.0f baud exactly", board_baud(&board));
}

static void one_pulse(void) {
    forget();
    send("T");
    run(US(25000));
    verdict(seen.pulses == 1 && !seen.torn && seen.answered == 1 && seen.answers[0].letter == ANSWER_PULSE,
            "one request", "one pulse of %.2f us, all three pins in one cycle, answered once", seen.length_us.least);
}

static void lengths(void) {
    static const uint32_t LENGTHS_US[] = {100, 101, 5000, 16383, 16384, 32768, 40000, 65536, 1000000, 20000};
    struct range error_us = NOTHING;
    bool answered = true;
    for (size_t i = 0; i < sizeof LENGTHS_US / sizeof *LENGTHS_US; i++) {
        char command[16];
        snprintf(command, sizeof command, "L%" PRIu32 "\n", LENGTHS_US[i]);
        forget();
        send(command);
        run(US(2000));
        answered &= only(ANSWER_LENGTH, LENGTHS_US[i], LENGTHS_US[i]);
        for (int phase = 0; phase < 20; phase++) {
            seen.length_us = NOTHING;
            send("T");
            run(US(LENGTHS_US[i] + 2000) + 27011 * phase);
            widen(&error_us, seen.length_us.least - LENGTHS_US[i]);
            widen(&error_us, seen.length_us.most - LENGTHS_US[i]);
        }
    }
    verdict(answered && error_us.least > -1 && error_us.most < 3, "length is settable",
            "100 us to 1 s, off by %+.2f to %+.2f us", error_us.least, error_us.most);

    static const struct {
        const char *command;
        uint32_t asked;
    } REFUSED[] = {{"L\n", 0}, {"L99\r", 99}, {"L1000001\n", 1000001}, {"L999999999\n", 999999999}};
    bool refused = true;
    for (size_t i = 0; i < sizeof REFUSED / sizeof *REFUSED; i++) {
        forget();
        send(REFUSED[i].command);
        run(US(2000));
        refused &= only(ANSWER_LENGTH, 20000, REFUSED[i].asked);
    }
    forget();
    send("L300T\n");
    run(US(25000));
    refused &= seen.pulses == 1 && lines(ANSWER_UNKNOWN) == 1 && seen.length_us.most > 19000;
    verdict(refused, "length out of range", "answered and not taken, nor one cut short by another request");
}

static void ten_thousand(void) {
    forget();
    struct range clock_error_us = NOTHING;
    bool consecutive = true;
    uint32_t noise = 1;
    double expected_us = 0;
    for (int i = 0; i < 10000; i++) {
        const avr_cycle_count_t before = seen.rise;
        const size_t answered = seen.answered;
        send("T");
        noise = noise * 1664525 + 1013904223; // any phase to the timer's laps
        run(US(20600) + noise % US(1000));
        consecutive &= seen.answered == answered + 1;
        const struct answer *answer = &seen.answers[seen.answered - 1];
        consecutive &= answer->letter == ANSWER_PULSE;
        if (i) {
            consecutive &= answer->first == answer[-1].first + 1 && answer->second > answer[-1].second;
            expected_us += (double)(seen.rise - before) / MHZ;
            widen(&clock_error_us, (uint32_t)(answer->second - seen.answers[0].second) - expected_us);
        }
    }
    verdict(seen.pulses == 10000 && seen.answered == 10000 && consecutive && !seen.torn && !seen.garbled,
            "10,000 requests", "%u pulses, %zu answers with consecutive numbers, %u torn edges", seen.pulses,
            lines(ANSWER_PULSE), seen.torn);
    verdict(seen.latency_cycles.most < 160,
            "byte to edge", "%.0f cycles, %.2f us, for %u of them, at most %.0f cycles, %.2f us",
            seen.latency_cycles.least, seen.latency_cycles.least / MHZ, seen.soonest, seen.latency_cycles.most,
            seen.latency_cycles.most / MHZ);
    verdict(seen.length_us.least > 19999 && seen.length_us.most < 20005, "pulse length", "%.2f to %.2f us",
            seen.length_us.least, seen.length_us.most);
    verdict(clock_error_us.least > -1.5 && clock_error_us.most < 1.5, "clock against the pins",
            "%+.2f to %+.2f us over %.0f s", clock_error_us.least, clock_error_us.most, expected_us / 1e6);
}

// A request that has arrived whole at a given cycle.
static void request_at(avr_cycle_count_t cycle) {
    run(cycle - FRAME_CYCLES - board.avr->cycle);
    send("T");
    run(US(22000));
}

// Requests at every cycle around the moments at which the timer's own interrupts come between.
static void races(void) {
    forget();
    enum { AROUND = 400 };
    struct range clock_error_us = NOTHING;
    unsigned requests = 0;
    for (int moment = 0; moment < 3; moment++) {
        for (int offset = -AROUND; offset < AROUND; offset++) {
            requests += 2;
            send("T");
            run(moment == 0 ? US(10000) : US(22000));
            const struct answer first = seen.answers[seen.answered - 1];
            const avr_cycle_count_t rise = seen.rise;
            const unsigned pulses = seen.pulses;
            if (moment == 0) request_at(rise + US(20000) + offset); // the pulse's end
            if (moment == 1) request_at(seen.fall + LAP_CYCLES + offset); // the same compare, a lap later
            if (moment == 2) request_at(rise + US(2 * LAP_US - first.second % LAP_US) + offset); // the clock's overflow
            if (seen.pulses > pulses)
                widen(&clock_error_us, (uint32_t)(seen.answers[seen.answered - 1].second - first.second) -
                                           (double)(seen.rise - rise) / MHZ);
        }
    }
    verdict(seen.answered == requests && seen.pulses == lines(ANSWER_PULSE) && !seen.torn && !seen.garbled &&
                seen.pulses + total(ANSWER_BUSY) == requests && seen.length_us.least > 19999 &&
                seen.length_us.most < 20012 && seen.latency_cycles.most < 250 && clock_error_us.least > -1.5 && clock_error_us.most < 1.5,
            "races with the timer",
            "%u requests, %zu refused; byte to edge %.0f to %.0f cycles; length %.2f to %.2f us; clock %+.2f to %+.2f us",
            requests, lines(ANSWER_BUSY), seen.latency_cycles.least, seen.latency_cycles.most, seen.length_us.least,
            seen.length_us.most, clock_error_us.least, clock_error_us.most);
}

static void busy(void) {
    forget();
    send("T");
    run(US(1000));
    const struct answer pulse = seen.answers[0];
    bool each = seen.answered == 1;
    for (int i = 0; i < 18; i++) {
        forget();
        send("T");
        run(US(1000));
        each &= only(ANSWER_BUSY, 1, pulse.first) && !seen.pulses;
    }
    run(US(2000));
    verdict(each, "requests in a pulse", "18, a millisecond apart, each refused on its own, naming the pulse");
}

static void flood(const char *name, int requests, bool one) {
    forget();
    for (int i = 0; i < requests; i++) send("T");
    run(US(requests * 20 + 1030000));
    const uint64_t pulses = lines(ANSWER_PULSE), refused = total(ANSWER_BUSY);
    verdict(pulses + refused == (uint64_t)requests && pulses == seen.pulses && (!one || pulses == 1) && !seen.torn &&
                !seen.garbled && !lines(ANSWER_OVERRUN) && !lines(ANSWER_RESET) && seen.latency_cycles.most < 250,
            name, "%d at line rate: %" PRIu64 " pulses + %" PRIu64 " refused in %zu answers; byte to edge %.0f to "
            "%.0f cycles; length %.2f to %.2f us",
            requests, pulses, refused, lines(ANSWER_BUSY), seen.latency_cycles.least, seen.latency_cycles.most,
            seen.length_us.least, seen.length_us.most);
}

static void unknown_bytes(void) {
    bool each = true;
    for (int byte = 0; byte < 256; byte++) {
        if (strchr("TSL\r\n", byte) && byte) continue;
        forget();
        board_send(&board, &(uint16_t){byte}, 1);
        run(US(1000));
        each &= only(ANSWER_UNKNOWN, 1, byte) && !seen.pulses;
    }
    forget();
    for (int i = 0; i < 5000; i++) send("x");
    run(US(110000));
    verdict(each && total(ANSWER_UNKNOWN) == 5000 && !lines(ANSWER_OVERRUN), "unknown bytes",
            "251 values answered each, 5000 at line rate counted in %zu answers", lines(ANSWER_UNKNOWN));
    forget();
    send("\r\n\n");
    run(US(1000));
    verdict(seen.answered == 0, "line ends alone", "are no requests");
}

static void line_errors(void) {
    forget();
    board.deaf = true;
    send("xxxxxx"); // two are held, one waits in the shift register, the others push each other out of it
    run(US(150));
    board.deaf = false;
    run(US(3000));
    verdict(total(ANSWER_OVERRUN) == 1 && total(ANSWER_UNKNOWN) == 3, "overrun",
            "three bytes of six survive 150 us without interrupts, and O says that some did not");

    forget();
    board_send(&board, &(uint16_t){'T' | BROKEN}, 1);
    run(US(1000));
    const bool no_pulse = only(ANSWER_FRAMING, 1, 'T') && !seen.pulses;
    forget();
    send("L3");
    board_send(&board, &(uint16_t){'0' | BROKEN}, 1);
    send("0\n");
    run(US(3000));
    send("L\n");
    run(US(1000));
    verdict(no_pulse && seen.answers[seen.answered - 1].first == 20000, "framing error",
            "answered; a broken T raises nothing, a broken digit spoils its length");
}

static void watchdog(const char *name, bool *fault) {
    send("T");
    run(US(10000));
    forget();
    const avr_cycle_count_t start = board.avr->cycle;
    const unsigned resets = board.resets;
    const uint8_t before = board.pins;
    *fault = true;
    while (board.resets == resets && board.avr->cycle - start < US(1000000)) run(1);
    const double ms = (board.avr->cycle - start) / (MHZ * 1e3);
    board_step(&board);
    const bool idle = before == RAISED && board.pins == IDLE;
    run(US(2000));
    const bool told = only(ANSWER_RESET, WATCHDOG, PROTOCOL_VERSION);
    forget();
    send("T");
    run(US(25000));
    verdict(idle && told && seen.pulses == 1 && seen.answers[0].first == 1, name,
            "reset after %.0f ms, lines idle, says R, numbers start at 1 again", ms);
}

static void clock_wraps(void) {
    forget();
    send("S");
    run(US(1000));
    const uint32_t before = seen.answers[0].second;
    const avr_cycle_count_t start = board.avr->cycle;
    run(US(1ull << 32));
    send("S");
    const double ran_us = (double)(board.avr->cycle - start) / MHZ;
    run(US(1000));
    const double error_us = (uint32_t)(seen.answers[1].second - before) + 4294967296.0 - ran_us;
    verdict(seen.answered == 2 && error_us > -1100 && error_us < 1100, "clock wraps",
            "after 2^32 us, %.0f s, idle throughout", ran_us / 1e6);
}

int main(int argc, char **argv) {
    if (argc != 2) return fprintf(stderr, "usage: check FILE.hex\n"), 2;
    board.on_pins = pins_changed;
    board.on_sent = byte_sent;
    if (!board_open(&board, argv[1])) return 1;

    power_on();
    one_pulse();
    lengths();
    ten_thousand();
    races();
    busy();
    flood("flood in a pulse", 900, true);
    flood("long flood", 50000, false);
    send("L100\n"), run(US(1000));
    flood("flood of short pulses", 50000, false);
    send("L20000\n"), run(US(1000));
    unknown_bytes();
    line_errors();
    watchdog("everything hangs", &board.hung);
    watchdog("interrupts hang", &board.deaf);
    clock_wraps();
    printf("%s\n", failures ? "FAILED" : "all passed");
    return failures != 0;
}
