// Measures the firmware on the pins of the simulated board, to the cycle. Usage: check FILE.hex
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "bench.h"

enum { POWER_ON = 1, WATCHDOG = 8, LAP_CYCLES = 0x10000 * 8, LAP_US = LAP_CYCLES / MHZ };

static void power_on(void) {
    forget();
    run(US(2000));
    verdict(only(ANSWER_RESET, POWER_ON, PROTOCOL_VERSION) && !seen.pulses && !seen.torn && board_baud(&board) == BAUD,
            "power on", "says R once, the lines stay idle, %.0f baud exactly", board_baud(&board));
}

static void one_pulse(void) {
    forget();
    request("T");
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
        request(command);
        run(US(2000));
        answered &= only(ANSWER_LENGTH, LENGTHS_US[i], LENGTHS_US[i]);
        for (int phase = 0; phase < 20; phase++) {
            seen.length_us = NOTHING;
            request("T");
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
        request(REFUSED[i].command);
        run(US(2000));
        refused &= only(ANSWER_LENGTH, 20000, REFUSED[i].asked);
    }
    forget();
    request("L300T\n");
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
    struct answer previous = {0};
    for (int i = 0; i < 10000; i++) {
        const avr_cycle_count_t before = seen.rise;
        const size_t answered = seen.answered;
        request("T");
        noise = noise * 1664525 + 1013904223; // any phase to the timer's laps
        run(US(20600) + noise % US(1000));
        consecutive &= seen.answered == answered + 1;
        const struct answer answer = last();
        consecutive &= answer.letter == ANSWER_PULSE;
        if (i) {
            consecutive &= answer.first == previous.first + 1 && answer.second > previous.second;
            expected_us += (double)(seen.rise - before) / MHZ;
            widen(&clock_error_us, (uint32_t)(answer.second - seen.answers[0].second) - expected_us);
        }
        previous = answer;
    }
    verdict(seen.pulses == 10000 && seen.answered == 10000 && consecutive && !seen.torn && !seen.garbled,
            "10,000 requests", "%u pulses, %zu answers with consecutive numbers, %u torn edges", seen.pulses,
            lines(ANSWER_PULSE), seen.torn);
    verdict(seen.latency_cycles.most < 160, "byte to edge",
            "%.0f cycles, %.2f us, for %u of them, at most %.0f cycles, %.2f us",
            seen.latency_cycles.least, seen.latency_cycles.least / MHZ, seen.soonest, seen.latency_cycles.most,
            seen.latency_cycles.most / MHZ);
    verdict(seen.length_us.least > 19999 && seen.length_us.most < 20005, "pulse length", "%.2f to %.2f us",
            seen.length_us.least, seen.length_us.most);
    verdict(clock_error_us.least > -1.5 && clock_error_us.most < 1.5, "clock against the pins",
            "%+.2f to %+.2f us over %.0f s", clock_error_us.least, clock_error_us.most, expected_us / 1e6);
}

// A request that has arrived completely at a given cycle.
static void request_at(avr_cycle_count_t cycle) {
    run(cycle - FRAME_CYCLES - board.avr->cycle);
    request("T");
    run(US(22000));
}

// Requests at every cycle around the moments at which the timer's own interrupts intervene.
static void races(void) {
    forget();
    enum { AROUND = 400 };
    struct range clock_error_us = NOTHING;
    unsigned requests = 0;
    for (int moment = 0; moment < 3; moment++) {
        for (int offset = -AROUND; offset < AROUND; offset++) {
            requests += 2;
            request("T");
            run(moment == 0 ? US(10000) : US(22000));
            const struct answer first = last();
            const avr_cycle_count_t rise = seen.rise;
            const unsigned pulses = seen.pulses;
            const avr_cycle_count_t moments[] = {
                rise + US(20000),                              // the pulse's end
                seen.fall + LAP_CYCLES,                        // the same compare, a lap later
                rise + US(2 * LAP_US - first.second % LAP_US), // the clock's overflow
            };
            request_at(moments[moment] + offset);
            if (seen.pulses > pulses)
                widen(&clock_error_us, (uint32_t)(last().second - first.second) -
                                           (double)(seen.rise - rise) / MHZ);
        }
    }
    const bool accounted = seen.answered == requests && seen.pulses == lines(ANSWER_PULSE) &&
                           seen.pulses + total(ANSWER_BUSY) == requests;
    const bool in_time = seen.length_us.least > 19999 && seen.length_us.most < 20012 &&
                         seen.latency_cycles.most < 250 && clock_error_us.least > -1.5 && clock_error_us.most < 1.5;
    verdict(accounted && in_time && !seen.torn && !seen.garbled, "races with the timer",
            "%u requests, %zu refused; byte to edge %.0f to %.0f cycles; length %.2f to %.2f us; "
            "clock %+.2f to %+.2f us",
            requests, lines(ANSWER_BUSY), seen.latency_cycles.least, seen.latency_cycles.most, seen.length_us.least,
            seen.length_us.most, clock_error_us.least, clock_error_us.most);
}

static void busy(void) {
    forget();
    request("T");
    run(US(1000));
    const struct answer pulse = seen.answers[0];
    bool each = seen.answered == 1;
    for (int i = 0; i < 18; i++) {
        forget();
        request("T");
        run(US(1000));
        each &= only(ANSWER_BUSY, 1, pulse.first) && !seen.pulses;
    }
    run(US(2000));
    verdict(each, "requests in a pulse", "18, a millisecond apart, each refused on its own, naming the pulse");
}

static void flood(const char *name, int requests, bool one) {
    forget();
    for (int i = 0; i < requests; i++) request("T");
    run(US(requests * 20 + 1030000));
    const uint64_t pulses = lines(ANSWER_PULSE), refused = total(ANSWER_BUSY);
    const bool accounted = pulses + refused == (uint64_t)requests && pulses == seen.pulses && (!one || pulses == 1);
    const bool sound = !seen.torn && !seen.garbled && !lines(ANSWER_OVERRUN) && !lines(ANSWER_RESET);
    const bool told_in_time = lines(ANSWER_BUSY) >= pulses / 2;
    verdict(accounted && sound && told_in_time && seen.latency_cycles.most < 250, name,
            "%d at line rate: %" PRIu64 " pulse%s + %" PRIu64 " refused in %zu answers; "
            "byte to edge %.0f to %.0f cycles; length %.2f to %.2f us",
            requests, pulses, pulses == 1 ? "" : "s", refused, lines(ANSWER_BUSY), seen.latency_cycles.least, seen.latency_cycles.most,
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
    for (int i = 0; i < 5000; i++) request("x");
    run(US(110000));
    verdict(each && total(ANSWER_UNKNOWN) == 5000 && !lines(ANSWER_OVERRUN), "unknown bytes",
            "251 values answered each, 5000 at line rate counted in %zu answers", lines(ANSWER_UNKNOWN));
    forget();
    request("\r\n\n");
    run(US(1000));
    verdict(seen.answered == 0, "line ends alone", "are no requests");
}

// True if each status came after the answers to everything it counts.
static bool status_is_last(void) {
    uint32_t pulses = seen.answers[0].first - 1;
    for (size_t i = 0; i < seen.answered; i++) {
        const struct answer *answer = &seen.answers[i];
        if (answer->letter == ANSWER_PULSE) pulses = answer->first;
        if (answer->letter == ANSWER_STATUS && answer->first != pulses) return false;
    }
    return true;
}

static void random_bytes(void) {
    static const char BYTES[] = "TTTTSL0123456789\r\nx";
    forget();
    request("T");
    uint32_t noise = 1;
    unsigned requests = 1;
    for (int i = 0; i < 100000; i++) {
        noise = noise * 1664525 + 1013904223;
        const char byte[] = {BYTES[(noise >> 24) % (sizeof BYTES - 1)], 0};
        requests += *byte == REQUEST_PULSE;
        request(byte);
        if (noise & 0x800000) run(noise >> 8 & 0x7fff);
    }
    run(US(2000000));
    request("L20000\n");
    run(US(1000));
    const uint64_t pulses = lines(ANSWER_PULSE), refused = total(ANSWER_BUSY);
    const bool sound = !seen.torn && !seen.garbled && !lines(ANSWER_OVERRUN) && !lines(ANSWER_FRAMING);
    verdict(pulses + refused == requests && pulses == seen.pulses && sound && !lines(ANSWER_RESET) && status_is_last(),
            "random bytes", "100000 in bursts, %u requests: %" PRIu64 " pulses + %" PRIu64 " refused; %zu status, each "
            "after what it counts", requests, pulses, refused, lines(ANSWER_STATUS));
}

static void line_errors(void) {
    forget();
    board.deaf = true;
    request("xxxxxx"); // two are held, one waits in the shift register, the others push each other out of it
    run(US(150));
    board.deaf = false;
    run(US(3000));
    verdict(total(ANSWER_OVERRUN) == 1 && total(ANSWER_UNKNOWN) == 3, "overrun",
            "three bytes of six survive 150 us without interrupts, and O says that some did not");

    forget();
    request("L30");
    run(US(200));
    board.deaf = true;
    request("0000\n");
    run(US(150));
    board.deaf = false;
    run(US(3000));
    request("L\n");
    run(US(1000));
    verdict(last().first == 20000 && lines(ANSWER_OVERRUN) == 1, "overrun in a length",
            "spoils it, instead of making it shorter");

    forget();
    board_send(&board, &(uint16_t){'T' | BROKEN}, 1);
    run(US(1000));
    const bool no_pulse = only(ANSWER_FRAMING, 1, 'T') && !seen.pulses;
    forget();
    request("L300");
    board_send(&board, &(uint16_t){'0' | BROKEN}, 1);
    request("0\n");
    run(US(3000));
    request("L\n");
    run(US(1000));
    verdict(no_pulse && last().first == 20000, "framing error",
            "answered; a broken T raises nothing, a broken digit spoils its length");
}

static void watchdog(const char *name, bool *fault) {
    request("T");
    run(US(10000));
    forget();
    const avr_cycle_count_t start = board.avr->cycle;
    const unsigned resets = board.resets;
    const uint8_t before = board.pins;
    *fault = true;
    while (board.resets == resets && board.avr->cycle - start < US(1000000)) run(1);
    *fault = false;
    const double ms = (board.avr->cycle - start) / (MHZ * 1e3);
    board_step(&board);
    const bool idle = before == RAISED && board.pins == IDLE;
    run(US(2000));
    const bool told = only(ANSWER_RESET, WATCHDOG, PROTOCOL_VERSION);
    forget();
    request("T");
    run(US(25000));
    verdict(idle && told && seen.pulses == 1 && seen.answers[0].first == 1, name,
            "reset after %.0f ms, lines idle, says R, numbers start at 1 again", ms);
}

static void clock_wraps(void) {
    forget();
    request("S");
    run(US(1000));
    const uint32_t before = seen.answers[0].second;
    const avr_cycle_count_t start = board.avr->cycle;
    run(US(1ull << 32));
    request("S");
    const double ran_us = (double)(board.avr->cycle - start) / MHZ;
    run(US(1000));
    const double error_us = (uint32_t)(seen.answers[1].second - before) + 4294967296.0 - ran_us;
    verdict(seen.answered == 2 && error_us > -1100 && error_us < 1100, "clock wraps",
            "after 2^32 us, %.0f s, idle throughout", ran_us / 1e6);
}

int main(int argc, char **argv) {
    if (argc != 2) return fprintf(stderr, "usage: check FILE.hex\n"), 2;
    if (!bench_open(argv[1])) return 1;

    power_on();
    one_pulse();
    lengths();
    ten_thousand();
    races();
    busy();
    flood("flood in a pulse", 900, true);
    flood("long flood", 50000, false);
    request("L100\n"), run(US(1000));
    flood("flood of short pulses", 50000, false);
    request("L20000\n"), run(US(1000));
    unknown_bytes();
    random_bytes();
    line_errors();
    watchdog("everything hangs", &board.hung);
    watchdog("interrupts hang", &board.deaf);
    clock_wraps();
    printf("%s\n", failures ? "FAILED" : "all passed");
    return failures != 0;
}
