// A simulated board on a pty. Usage: sim [--fast] [--hang N] [--noise N] FILE.hex
//
// Prints the pty's path, then runs until it is killed; at SIGINT or SIGTERM it prints the number of pulses on its pins.
// Opening the path resets the board, like opening the port of an Uno. It runs in real time; with --fast as fast as it
// can, and its clock hardly advances while nothing happens. With --hang it hangs at the N-th request for a pulse, until
// its watchdog resets it; with --noise the line adds a request after the N-th pulse, unknown to the host.
#define _GNU_SOURCE
#include <errno.h>
#include <fcntl.h>
#include <getopt.h>
#include <poll.h>
#include <pty.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "board.h"

enum { TICK_US = 500, LEAD_NS = 2 * TICK_US * 1000 };

static struct board board;
static bool fast;
static volatile sig_atomic_t stopped;

static int pty;
static bool opened, reset_wanted;
static uint8_t unsent[4096];
static size_t unsent_count;
static unsigned long pulses, requests;
static unsigned long hang_at, noise_after; // counted from 1; 0 is never
static bool noise;

static struct timespec start;

static void stop(int signal) {
    (void)signal;
    stopped = 1;
}

static void pins_changed(struct board *b, uint8_t before, uint8_t after) {
    (void)b, (void)before;
    pulses += after == RAISED;
    noise |= after == IDLE && pulses == noise_after;
}

// Unread bytes are lost, as on a real line.
static void byte_sent(struct board *b, uint8_t byte) {
    (void)b;
    if (opened && unsent_count < sizeof unsent) unsent[unsent_count++] = byte;
}

static int64_t ahead_of_real_time_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const int64_t real_ns = (now.tv_sec - start.tv_sec) * 1000000000LL + now.tv_nsec - start.tv_nsec;
    return (int64_t)(board.avr->cycle * 1000 / MHZ) - real_ns;
}

// Waits until the host has sent something or the next step is due. Time passes no faster for a host that never stops
// sending.
static void wait_for_host(bool idle) {
    const int64_t ahead_ns = ahead_of_real_time_ns();
    struct timespec time = {ahead_ns / 1000000000, ahead_ns % 1000000000};
    if (fast) time = (struct timespec){0, idle ? 10000000 : 0};
    if (!fast && ahead_ns <= 0) time = (struct timespec){0, 0};
    struct pollfd poll = {pty, POLLIN, 0};
    const bool listen = opened && (fast || ahead_ns < LEAD_NS); // a pty that nobody has open would not let us wait
    ppoll(&poll, listen, &time, NULL);
}

static avr_cycle_count_t tick(struct board *b) {
    const bool idle = board_wire_is_quiet(b) && b->pins == IDLE && !unsent_count;
    const ssize_t written = unsent_count ? write(pty, unsent, unsent_count) : 0;
    if (written > 0) memmove(unsent, unsent + written, unsent_count -= written);
    wait_for_host(idle);

    struct pollfd state = {pty, POLLIN, 0};
    poll(&state, 1, 0);
    const bool was_open = opened;
    opened = !(state.revents & POLLHUP);
    reset_wanted = opened && !was_open;
    if (!opened) unsent_count = 0;

    uint8_t bytes[TICK_US * MHZ / FRAME_CYCLES]; // what the line carries in a tick; the rest waits in the pty
    const ssize_t count = opened && was_open && state.revents & POLLIN ? read(pty, bytes, sizeof bytes) : 0;
    for (ssize_t i = 0; i < count; i++) {
        requests += bytes[i] == REQUEST_PULSE;
        b->hung |= bytes[i] == REQUEST_PULSE && requests == hang_at;
        board_send(b, &(uint16_t){bytes[i]}, 1);
    }
    if (noise) board_send(b, &(uint16_t){REQUEST_PULSE}, 1);
    noise = false;
    return TICK_US * MHZ;
}

// Raw from the start: an echo would send the board its own answers.
static bool open_pty(void) {
    struct termios raw = {0};
    cfmakeraw(&raw);
    raw.c_cflag |= CREAD;
    char path[64];
    int port;
    if (openpty(&pty, &port, path, &raw, NULL) || fcntl(pty, F_SETFL, O_NONBLOCK)) return false;
    close(port); // from now on it is open when the host has it open
    puts(path);
    return fflush(stdout) == 0;
}

int main(int argc, char **argv) {
    static const struct option OPTIONS[] = {{"fast", no_argument, NULL, 'f'},
                                            {"hang", required_argument, NULL, 'h'},
                                            {"noise", required_argument, NULL, 'n'},
                                            {0}};
    for (int option; (option = getopt_long(argc, argv, "", OPTIONS, NULL)) != -1;) {
        if (option == 'f') fast = true;
        if (option == 'h') hang_at = strtoul(optarg, NULL, 10);
        if (option == 'n') noise_after = strtoul(optarg, NULL, 10);
        if (option == '?') return 2;
    }
    if (argc != optind + 1) return fprintf(stderr, "usage: sim [--fast] [--hang N] [--noise N] FILE.hex\n"), 2;
    signal(SIGINT, stop);
    signal(SIGTERM, stop);
    board.on_pins = pins_changed;
    board.on_sent = byte_sent;
    board.on_tick = tick;
    if (!board_open(&board, argv[optind])) return 1;
    if (!open_pty()) return perror("no pty"), 1;
    clock_gettime(CLOCK_MONOTONIC, &start);

    while (!stopped && board_step(&board)) {
        if (reset_wanted) {
            reset_wanted = false;
            board_reset(&board);
        }
    }
    printf("pulses %lu\n", pulses);
    return !stopped;
}
