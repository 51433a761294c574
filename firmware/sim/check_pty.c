// Talks to the simulated board as a host does. Usage: check_pty SIM FILE.hex
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "../protocol.h"
#include "answer.h"

enum { TIMEOUT_MS = 3000 };

static int port;
static pid_t child;

static void fail(const char *what) {
    printf("FAIL pty: %s\n", what);
    if (child) kill(child, SIGKILL);
    exit(1);
}

static struct answer receive(void) {
    char line[64];
    size_t length = 0;
    struct answer answer;
    for (;;) {
        struct pollfd readable = {port, POLLIN, 0};
        if (poll(&readable, 1, TIMEOUT_MS) != 1 || read(port, &line[length], 1) != 1) fail("no answer");
        if (line[length] != '\n') {
            if (++length == sizeof line) fail("no line end");
            continue;
        }
        line[length] = 0;
        if (length && !answer_parse(line, &answer)) fail(line);
        if (length) return answer;
        length = 0;
    }
}

static struct answer ask(char request) {
    if (write(port, &request, 1) != 1) fail("cannot write");
    return receive();
}

static void open_port(const char *path) {
    struct termios settings;
    port = open(path, O_RDWR | O_NOCTTY);
    if (port < 0 || tcgetattr(port, &settings)) fail(path);
    cfmakeraw(&settings);
    tcsetattr(port, TCSANOW, &settings);
    const struct answer answer = receive();
    if (answer.letter != ANSWER_RESET || answer.second != PROTOCOL_VERSION) fail("opening did not reset the board");
}

static double now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now.tv_sec * 1e6 + now.tv_nsec / 1e3;
}

// Returns the time by which the board's clock got ahead of the host's meanwhile.
static double pulses(uint32_t count) {
    const double start_us = now_us() - ask(REQUEST_STATUS).second;
    struct answer status = {0};
    for (uint32_t number = 1; number <= count; number++) {
        const struct answer pulse = ask(REQUEST_PULSE);
        if (pulse.letter != ANSWER_PULSE || pulse.first != number) fail("not the next pulse");
        do { // the board's own clock says when the pulse is over
            status = ask(REQUEST_STATUS);
            if (status.letter != ANSWER_STATUS || status.first != number) fail("no status");
        } while (status.second - pulse.second < LENGTH_DEFAULT_US + 1000);
    }
    return status.second - (now_us() - start_us);
}

static double session(char **command, unsigned count) {
    int output[2];
    if (pipe(output)) fail("no pipe");
    child = fork();
    if (child == 0) {
        dup2(output[1], STDOUT_FILENO);
        execv(command[0], command);
        _exit(127);
    }
    close(output[1]);
    FILE *said = fdopen(output[0], "r");
    char path[64], tally[64], expected[64];
    if (!fgets(path, sizeof path, said)) fail("the board does not start");
    path[strcspn(path, "\n")] = 0;

    open_port(path);
    const double ahead_us = pulses(count);
    close(port);
    usleep(20000); // the board looks every half millisecond
    open_port(path);
    pulses(1);

    kill(child, SIGTERM);
    snprintf(expected, sizeof expected, "pulses %u\n", count + 1);
    if (!fgets(tally, sizeof tally, said) || strcmp(tally, expected)) fail("other pulses on the pins than answered");
    fclose(said);
    close(port);
    waitpid(child, NULL, 0);
    return ahead_us;
}

int main(int argc, char **argv) {
    if (argc != 3) return fprintf(stderr, "usage: check_pty SIM FILE.hex\n"), 2;
    if (session((char *[]){argv[1], argv[2], NULL}, 30) > 5000) fail("faster than real time");
    session((char *[]){argv[1], "--fast", argv[2], NULL}, 1000);
    printf("ok   %-22s %s\n", "pty", "30 pulses in real time, 1000 as fast as it goes; opening it resets the board");
}
