/* The serial line: what the firmware sends goes to the log line by line, and to a pseudo-terminal where there is one. */
#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <avr_uart.h>
#include <sim_cycle_timers.h>

#include "bench.h"

#define BYTE_CYCLES 1360 /* ten bits at 117647 baud, what the chip makes of 115200 */
#define TALK_CYCLES 1500 /* a byte to the processor: simavr's receiver loses some at 1389, the speed of a host */
#define SAID_MOST (1 << 16)

static struct bench *bench;
static avr_irq_t *input_irq;
static int terminal = -1;
static char line[512];
static size_t length;

/* To be sent to the firmware: bytes in their order, none before its time. */
static struct said {
  avr_cycle_count_t from;
  uint8_t byte;
} said[SAID_MOST];
static size_t said_count, said_at;
static avr_cycle_count_t noise_from, talking;
static uint32_t noise_left;

static void sent(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
  (void)irq;
  (void)parameter;
  char c = (char)value;
  if (terminal >= 0) {
    struct pollfd state = {.fd = terminal, .events = POLLOUT};
    /* Nobody has it open, or nobody reads: the bytes are lost, as on any serial line. */
    if (poll(&state, 1, 0) >= 0 && !(state.revents & POLLHUP) && write(terminal, &c, 1) < 0 && errno != EAGAIN) {
      perror("bench: the terminal");
      exit(1);
    }
  }
  if (!bench->log)
    return;
  if (length < sizeof line - 1)
    line[length++] = c;
  if (c != '\n')
    return;
  fprintf(bench->log, "U %llu ", (unsigned long long)(bench->avr->cycle + BYTE_CYCLES));
  for (size_t i = 0; i < length; i++)
    fprintf(bench->log, "%02x", (uint8_t)line[i]);
  fputc('\n', bench->log);
  length = 0;
}

static avr_cycle_count_t say(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
  (void)parameter;
  if (said_at < said_count && said[said_at].from <= avr->cycle)
    avr_raise_irq(input_irq, said[said_at++].byte);
  else if (noise_left && noise_from <= avr->cycle) {
    /* Half of them of the bytes that commands are made of, so that some are obeyed. */
    static const char words[] = "?RGJN0123456789,,\n\n\r-x";
    double draw = chance_uniform();
    uint8_t any = (uint8_t)(chance_uniform() * 256.0);
    avr_raise_irq(input_irq, draw < 0.5 ? any : (uint8_t)words[any % (sizeof words - 1)]);
    noise_left--;
  }
  return when + TALK_CYCLES;
}

static void begin_to_say(void)
{
  if (!talking) {
    talking = 1;
    avr_cycle_timer_register(bench->avr, TALK_CYCLES, say, NULL);
  }
}

static void queue(avr_cycle_count_t from, uint8_t byte)
{
  if (said_at == said_count)
    said_at = said_count = 0;
  if (said_count == SAID_MOST)
    return; /* as a chip that is talked to too fast */
  said[said_count++] = (struct said){from, byte};
  begin_to_say();
}

void uart_say_at(double seconds, const char *text)
{
  for (; *text; text++)
    queue(cycles_of(bench, seconds), (uint8_t)*text);
  queue(cycles_of(bench, seconds), '\n');
}

void uart_noise_at(double seconds, uint32_t bytes)
{
  noise_from = cycles_of(bench, seconds);
  noise_left = bytes;
  begin_to_say();
}

int uart_silent(void) { return said_at == said_count && !noise_left; }

void uart_listen(void)
{
  uint8_t bytes[256];
  ssize_t got = read(terminal, bytes, sizeof bytes);
  for (ssize_t i = 0; i < got; i++)
    queue(0, bytes[i]);
}

void uart_attach(struct bench *at, int to)
{
  bench = at;
  terminal = to;
  uint32_t flags = 0;
  avr_ioctl(at->avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
  flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
  avr_ioctl(at->avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
  input_irq = avr_io_getirq(at->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
  avr_irq_register_notify(avr_io_getirq(at->avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent, NULL);
}
