#include "board.h"

#include <simavr/sim_core.h>
#include <simavr/sim_hex.h>
#include <simavr/sim_interrupts.h>
#include <simavr/sim_time.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

DEFINE_FIFO(uint16_t, uart_fifo);

enum { DDRB = 0x24, PORTB = 0x25, TCCR1A = 0x80, UCSR0A = 0xc0, U2X0 = 1 << 1, WGM10 = 1 << 0 };
enum { RECEIVER_FRAMES = 3, INTERRUPT_CYCLES = 4, WAKING_CYCLES = 4 };

static avr_cycle_count_t frame_arrived(avr_t *avr, avr_cycle_count_t when, void *param) {
    struct board *board = param;
    avr_uart_t *uart = board->uart;
    const uint16_t frame = board->wire[board->wire_tail++ % WIRE_BYTES];
    if (avr_regbit_get(avr, uart->rxen)) {
        if (uart_fifo_get_read_size(&uart->input) < RECEIVER_FRAMES) {
            uart_fifo_write(&uart->input, frame);
        } else { // takes the place of the one that waits in the shift register
            uart_fifo_write_at(&uart->input, -1, frame);
            avr_regbit_set(avr, uart->dor);
        }
        uart->rx_cnt = 0;
        avr_raise_interrupt(avr, &uart->rxc);
        board->received = avr->cycle;
    }
    return board_wire_is_quiet(board) ? 0 : when + FRAME_CYCLES;
}

static avr_cycle_count_t tick(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr;
    struct board *board = param;
    const avr_cycle_count_t next = board->on_tick(board);
    return next ? when + next : 0;
}

static void byte_sent(avr_irq_t *irq, uint32_t byte, void *param) {
    (void)irq;
    struct board *board = param;
    board->uart->cycles_per_byte = FRAME_CYCLES;
    if (board->on_sent) board->on_sent(board, byte);
}

static void interrupt_entered(avr_irq_t *irq, uint32_t vector, void *param) {
    (void)irq;
    struct board *board = param;
    if (vector) board->avr->cycle += INTERRUPT_CYCLES;
}

// simavr's reset clears all timers, including ours and that of the line.
static void was_reset(avr_io_t *io) {
    struct board *board = (struct board *)io;
    board->resets++;
    board->hung = board->deaf = false;
    board->wire_head = board->wire_tail = 0;
    if (board->on_tick) avr_cycle_timer_register(board->avr, 1, tick, board);
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles) {
    (void)avr, (void)cycles;
}

bool board_open(struct board *board, const char *hex) {
    uint32_t size, start;
    uint8_t *code = read_ihex_file(hex, &size, &start);
    if (!code) {
        fprintf(stderr, "%s: no Intel hex file\n", hex);
        return false;
    }
    avr_t *avr = board->avr = avr_make_mcu_by_name("atmega328p");
    avr_init(avr);
    avr->frequency = MHZ * 1000000;
    avr->sleep = no_sleep;
    avr_loadcode(avr, code, size, start);
    free(code);

    avr_io_t *io = avr->io_port;
    while (strcmp(io->kind, "uart")) io = io->next; // an ATmega328P has one
    board->uart = (avr_uart_t *)io;
    board->uart->flags = 0; // neither to the console nor slower when polled
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), byte_sent, board);
    avr_irq_register_notify(avr_get_interrupt_irq(avr, AVR_INT_ANY) + AVR_INT_IRQ_RUNNING, interrupt_entered, board);

    board->io = (avr_io_t){.kind = "board", .reset = was_reset};
    avr_register_io(avr, &board->io);
    board->pins = IDLE;
    avr->data[UCSR0A] |= U2X0;
    avr->data[TCCR1A] |= WGM10;
    if (board->on_tick) avr_cycle_timer_register(avr, 1, tick, board);
    return true;
}

bool board_send(struct board *board, const uint16_t *frames, size_t count) {
    if (board->wire_head - board->wire_tail + count > WIRE_BYTES) return false;
    const bool quiet = board_wire_is_quiet(board);
    for (size_t i = 0; i < count; i++) board->wire[board->wire_head++ % WIRE_BYTES] = frames[i];
    if (quiet && count) avr_cycle_timer_register(board->avr, FRAME_CYCLES, frame_arrived, board);
    return true;
}

void board_reset(struct board *board) {
    avr_reset(board->avr);
    avr_regbit_set(board->avr, board->avr->reset_flags.extrf);
}

double board_baud(const struct board *board) {
    const avr_uart_t *uart = board->uart;
    const unsigned divider = avr_regbit_get(board->avr, uart->ubrrl) | avr_regbit_get(board->avr, uart->ubrrh) << 8;
    return MHZ * 1e6 / (divider + 1) / (avr_regbit_get(board->avr, uart->u2x) ? 8 : 16);
}

bool board_wire_is_quiet(const struct board *board) {
    return board->wire_head == board->wire_tail;
}

static uint8_t pins(const avr_t *avr) {
    const uint8_t outputs = avr->data[DDRB];
    return PINS & ((avr->data[PORTB] & outputs) | (IDLE & ~outputs));
}

bool board_step(struct board *board) {
    avr_t *avr = board->avr;
    const avr_flashaddr_t pc = avr->pc;
    if (board->hung || board->deaf) avr->sreg[S_I] = 0, avr->state = cpu_Running;
    const bool asleep = avr->state == cpu_Sleeping;
    int state = avr_run(avr);
    // If simavr ends because nothing can wake the processor, the main loop continues.
    if (board->deaf && state == cpu_Done) state = avr->state = cpu_Running;
    if (asleep && state == cpu_Running) avr->cycle += WAKING_CYCLES;
    if (board->hung) avr->pc = pc;

    // The chip's receiver requests its interrupt as long as it holds a byte.
    if (!uart_fifo_isempty(&board->uart->input) && avr->sreg[S_I]) avr_raise_interrupt(avr, &board->uart->rxc);

    const uint8_t before = board->pins;
    board->pins = pins(avr);
    if (board->pins != before && board->on_pins) board->on_pins(board, before, board->pins);
    return state != cpu_Done && state != cpu_Crashed;
}

static avr_cycle_count_t nothing(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr, (void)when, (void)param;
    return 0;
}

bool board_run(struct board *board, avr_cycle_count_t cycles) {
    const avr_cycle_count_t end = board->avr->cycle + cycles;
    avr_cycle_timer_register(board->avr, cycles, nothing, board); // or a sleep would go on past the end
    while (board->avr->cycle < end)
        if (!board_step(board)) return false;
    return true;
}
