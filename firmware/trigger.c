// The trigger controller of annex F of the thesis, for an ATmega328P at 16 MHz (Arduino Uno or Nano).
//
// One byte from the host raises both camera lines with one port write. The interrupt that receives the byte does it, so
// that the time from byte to edge is the same for every pulse; a timer ends the pulse, so that the UART keeps working
// meanwhile. Nothing received is buffered, so no buffer can overflow: requests that cannot be answered one by one are
// counted, and the count is the answer. Answers are sent by the main loop, which sleeps when it has none.
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/sleep.h>
#include <avr/wdt.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <util/atomic.h>
#include <util/crc16.h>

#include "protocol.h"

// Port B: all three change with one write.
enum {
    LOW_LINE = _BV(PB0),  // D8, active low: Point Grey
    HIGH_LINE = _BV(PB1), // D9, active high: Basler
    LED = _BV(PB5),       // D13
    IDLE = LOW_LINE,
    RAISED = HIGH_LINE | LED,
};

enum { TICKS_PER_US = F_CPU / 8 / 1000000 };

// Delay of the interrupt that ends a pulse after the timer; sim/check.c measures it.
enum { LAG_TICKS = 10 };

// Each is sent in its turn; an event that happened several times is sent once, with its count. The status is sent when
// no other answer waits: its receiver knows that all earlier requests have been answered.
enum answer { PULSE, LENGTH, BUSY, OVERRUN, FRAMING, UNKNOWN, STATUS, ANSWERS };
static const char letters[ANSWERS] = {ANSWER_PULSE,   ANSWER_LENGTH,  ANSWER_BUSY,  ANSWER_OVERRUN,
                                      ANSWER_FRAMING, ANSWER_UNKNOWN, ANSWER_STATUS};
static volatile uint8_t waiting; // a bit per answer
static uint16_t counts[ANSWERS];
static uint8_t bytes[ANSWERS]; // the last that was counted

struct instant {
    uint32_t overflows;
    uint16_t ticks;
};

static volatile bool ticked; // an overflow since the watchdog was last fed
static uint32_t overflows;

static volatile bool raised;
static uint32_t pulses;
static struct instant rise;
static uint32_t ticks_left;

static uint32_t length_us = LENGTH_DEFAULT_US;
static uint32_t length_ticks = LENGTH_DEFAULT_US * TICKS_PER_US - LAG_TICKS;
static bool asking; // between 'L' and its line end
static uint32_t asked_us, answered_us;

static inline void count(enum answer kind, uint8_t byte) {
    counts[kind]++;
    bytes[kind] = byte;
    waiting |= _BV(kind);
}

// The time at which the timer read `ticks`; call it with interrupts off.
static inline struct instant at(uint16_t ticks) {
    const bool wrapped = (TIFR1 & _BV(TOV1)) && ticks < 0x8000;
    return (struct instant){overflows + wrapped, ticks};
}

// Since reset, modulo 2^32.
static uint32_t microseconds(struct instant instant) {
    return instant.overflows * (0x10000 / TICKS_PER_US) + instant.ticks / TICKS_PER_US;
}

// The next compare, never so far away that it could be taken for one just passed, nor so near that it could be missed.
static inline void arm(uint16_t from) {
    const uint16_t step = ticks_left > 0x7fff ? 0x4000 : ticks_left;
    ticks_left -= step;
    OCR1A = from + step;
}

static inline void raise_lines(void) {
    PORTB = RAISED;
    const uint16_t now = TCNT1;
    ticks_left = length_ticks;
    arm(now);
    raised = true;
    pulses++;
    rise = at(now);
    waiting |= _BV(PULSE);
}

ISR(TIMER1_COMPA_vect) {
    // It also fires once per lap without a pulse, and may have been due already when the pulse began.
    if (!raised || (int16_t)(TCNT1 - OCR1A) < 0) return;
    if (ticks_left) {
        arm(OCR1A);
    } else {
        PORTB = IDLE;
        raised = false;
    }
}

ISR(TIMER1_OVF_vect) {
    overflows++;
    ticked = true;
}

static void set_length(void) {
    if (asked_us >= LENGTH_MIN_US && asked_us <= LENGTH_MAX_US) {
        length_us = asked_us;
        length_ticks = asked_us * TICKS_PER_US - LAG_TICKS;
    }
    answered_us = asked_us;
    waiting |= _BV(LENGTH);
}

// A length that is interrupted by something else is discarded.
static inline void abandon_length(void) {
    if (asking) count(UNKNOWN, REQUEST_LENGTH);
    asking = false;
}

// A separate function, so that a pulse does not wait until the registers for all this are saved.
__attribute__((noinline)) static void other_request(uint8_t byte) {
    if (asking && byte >= '0' && byte <= '9') {
        if (asked_us < 100000000) asked_us = asked_us * 10 + (byte - '0');
        return;
    }
    if (byte == '\r' || byte == '\n') {
        if (asking) set_length();
        asking = false;
        return;
    }
    abandon_length();
    if (byte == REQUEST_LENGTH) {
        asking = true;
        asked_us = 0;
    } else if (byte == REQUEST_STATUS) {
        waiting |= _BV(STATUS);
    } else {
        count(UNKNOWN, byte);
    }
}

ISR(USART_RX_vect) {
    const uint8_t status = UCSR0A; // before UDR0, whose reading clears it
    const uint8_t byte = UDR0;
    if (status & _BV(DOR0)) {
        abandon_length();
        count(OVERRUN, byte);
    }
    if (status & _BV(FE0)) {
        abandon_length();
        count(FRAMING, byte);
    } else if (byte == REQUEST_PULSE) {
        if (raised || (waiting & _BV(PULSE))) {
            count(BUSY, byte);
        } else {
            raise_lines();
        }
        abandon_length();
    } else {
        other_request(byte);
    }
}

static char line[sizeof "P 4294967295 4294967295 FF\n"];
static const char *unsent = line; // up to the line's terminating zero

static void compose(char letter, uint32_t first, uint32_t second) {
    char *end = line;
    *end++ = letter;
    *end++ = ' ';
    end += strlen(ultoa(first, end, 10));
    *end++ = ' ';
    end += strlen(ultoa(second, end, 10));
    uint8_t crc = 0;
    for (const char *c = line; c < end; c++) crc = _crc8_ccitt_update(crc, *c);
    *end++ = ' ';
    if (crc < 0x10) *end++ = '0';
    end += strlen(utoa(crc, end, 16));
    strcpy(end, "\n");
    unsent = line;
}

static void compose_next(void) {
    static uint8_t kind;
    do kind = (kind + 1) % ANSWERS;
    while (!(waiting & _BV(kind)));

    uint32_t first, second;
    struct instant instant;
    ATOMIC_BLOCK(ATOMIC_FORCEON) {
        if (kind == STATUS && waiting != _BV(STATUS)) return; // the others first
        waiting &= ~_BV(kind);
        first = counts[kind];
        second = pulses;
        counts[kind] = 0;
        instant = kind == PULSE ? rise : at(TCNT1);
        if (kind == LENGTH) first = length_us, second = answered_us;
    }
    if (kind == PULSE || kind == STATUS) {
        first = second;
        second = microseconds(instant);
    } else if (kind == FRAMING || kind == UNKNOWN) {
        second = bytes[kind];
    }
    compose(letters[kind], first, second);
}

int main(void) {
    const uint8_t cause = MCUSR; // zero where a bootloader has cleared it
    MCUSR = 0;
    wdt_enable(WDTO_120MS);
    wdt_reset(); // simavr takes up the new period only here

    PORTB = IDLE; // before the pins become outputs, so that none glitches
    DDRB = LOW_LINE | HIGH_LINE | LED;

    // A bootloader may have left the UART and the timer in use.
    UCSR0B = 0; // drops what was received
    UCSR0A = 0;
    UBRR0 = F_CPU / 16 / BAUD - 1;
    UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
    UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);

    TCCR1A = 0;
    TCCR1B = _BV(CS11); // F_CPU / 8, running through
    TCNT1 = 0;
    TIMSK1 = _BV(OCIE1A) | _BV(TOIE1);

    UDR0 = '\n'; // ends the line that a reset may have cut off
    compose(ANSWER_RESET, cause, PROTOCOL_VERSION);
    set_sleep_mode(SLEEP_MODE_IDLE);
    sei();

    for (;;) {
        // The timer's interrupt proves that interrupts work, reaching this line that the main loop does.
        if (ticked) {
            ticked = false;
            wdt_reset();
        }
        if (*unsent) {
            if (UCSR0A & _BV(UDRE0)) UDR0 = *unsent++;
        } else if (waiting) {
            compose_next();
        } else {
            cli();
            if (!waiting && !ticked) {
                sleep_enable();
                sei();
                sleep_cpu();
                sleep_disable();
            }
            sei();
        }
    }
}
