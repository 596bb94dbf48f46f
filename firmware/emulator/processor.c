/* The ATmega328P in simavr.
 *
 * Debian's simavr 1.6 clears every flag of a timer on any write to its flag register. A program that clears the capture
 * flag then loses an overflow that waits, and with it 4096 us, about every 15 s. The chip clears the flags that are
 * written as ones and no others: flags_written() does that in its place.
 *
 * It also drives a compare output at the timer's overflow, as PWM would, where the chip in this mode does nothing:
 * compared() passes on what a match does and nothing else.
 */
#include <stdlib.h>
#include <string.h>

#include <avr_extint.h>
#include <avr_ioport.h>
#include <avr_timer.h>
#include <sim_elf.h>
#include <sim_io.h>

#include "bench.h"

#define TIFR1 0x36
#define RAM_START 0x100
#define PAINT 0xA5

static avr_timer_t *timer_1(avr_t *avr)
{
  for (avr_io_t *io = avr->io_port; io; io = io->next)
    if (!strcmp(io->kind, "timer") && ((avr_timer_t *)io)->name == '1')
      return (avr_timer_t *)io;
  fprintf(stderr, "bench: simavr has no timer 1 for this processor\n");
  exit(1);
}

static void flags_written(avr_t *avr, avr_io_addr_t address, uint8_t value, void *timer)
{
  (void)address;
  avr_timer_t *t = timer;
  avr_int_vector_t *vectors[] = {&t->overflow, &t->icr, &t->comp[AVR_TIMER_COMPA].interrupt,
                                 &t->comp[AVR_TIMER_COMPB].interrupt};
  for (size_t i = 0; i < sizeof vectors / sizeof *vectors; i++)
    if (value & (1 << vectors[i]->raised.bit))
      avr_clear_interrupt(avr, vectors[i]);
}

#define MATCH_LATE 32 /* cycles by which simavr may come to an event: an instruction, an interrupt */

static void compared(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
  (void)irq;
  avr_t *avr = parameter;
  avr_timer_t *t = timer_1(avr);
  uint16_t count = (uint16_t)(avr->cycle - t->tov_base);
  uint16_t match = (uint16_t)(avr->data[t->comp[AVR_TIMER_COMPA].r_ocr] | avr->data[t->comp[AVR_TIMER_COMPA].r_ocrh] << 8);
  if ((uint16_t)(count - match) < MATCH_LATE)
    avr_raise_irq(avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1), value);
}

/* The pace is kept elsewhere; a processor that sleeps is moved on to its next event at once. */
static void asleep(avr_t *avr, avr_cycle_count_t cycles)
{
  (void)avr;
  (void)cycles;
}

static void no_words(avr_t *avr, const int level, const char *format, va_list arguments)
{
  (void)avr;
  if (level <= LOG_ERROR)
    vfprintf(stderr, format, arguments);
}

avr_t *processor_start(const char *elf)
{
  elf_firmware_t firmware;
  memset(&firmware, 0, sizeof firmware);
  avr_global_logger_set(no_words);
  if (elf_read_firmware(elf, &firmware)) {
    fprintf(stderr, "bench: %s is no program for the processor; build it with `make firmware`\n", elf);
    exit(1);
  }
  avr_t *avr = avr_make_mcu_by_name("atmega328p");
  if (!avr) {
    fprintf(stderr, "bench: simavr does not know the atmega328p\n");
    exit(1);
  }
  avr_init(avr);
  avr->run_cycle_limit = 1000; /* instructions go on without a look at the events while none is due */
  avr->frequency = (uint32_t)CPU_HZ;
  avr_load_firmware(avr, &firmware);
  /* Levels at the two interrupt pins, which are not used, would be looked at in each cycle. */
  avr_extint_set_strict_lvl_trig(avr, EXTINT_IRQ_OUT_INT0, 0);
  avr_extint_set_strict_lvl_trig(avr, EXTINT_IRQ_OUT_INT1, 0);
  avr->sleep = asleep;
  avr->io[AVR_DATA_TO_IO(TIFR1)].w.c = flags_written;
  avr->io[AVR_DATA_TO_IO(TIFR1)].w.param = timer_1(avr);
  avr_irq_t *compare = avr_io_getirq(avr, AVR_IOCTL_TIMER_GETIRQ('1'), TIMER_IRQ_OUT_COMP + AVR_TIMER_COMPA);
  avr_unconnect_irq(compare, avr_io_getirq(avr, AVR_IOCTL_IOPORT_GETIRQ('B'), 1));
  avr_irq_register_notify(compare, compared, avr);
  memset(avr->data + RAM_START, PAINT, avr->ramend + 1u - RAM_START);
  return avr;
}

int processor_ram_used(const avr_t *avr)
{
  int longest = 0, run = 0;
  for (int at = RAM_START; at <= avr->ramend; at++) {
    run = avr->data[at] == PAINT ? run + 1 : 0;
    longest = run > longest ? run : longest;
  }
  return avr->ramend + 1 - RAM_START - longest;
}
