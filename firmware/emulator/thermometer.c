/* The DS18B20 on D2, alone on its bus: reset, skip ROM, convert, read (Maxim, DS18B20 data sheet 19-7487). */
#include <math.h>

#include <avr_ioport.h>
#include <sim_cycle_timers.h>

#include "bench.h"

#define DQ_PIN 2
#define RESET_S 400e-6
#define ONE_S 15e-6
#define HOLD_S 30e-6 /* a zero that it sends lasts so long */
#define SKIP_ROM 0xCC
#define CONVERT 0x44
#define READ_SCRATCH 0xBE

static struct bench *bench;
static avr_irq_t *dq_irq;
static avr_cycle_count_t low_since;
static int master_low, held_low;
static uint8_t scratch[9], byte, bits, out_at, out_bit;
static enum { NOBODY, ROM, FUNCTION, SENDING } state;
static double celsius;

static uint8_t crc8(const uint8_t *data, int count)
{
  uint8_t crc = 0;
  for (int i = 0; i < count; i++)
    for (int bit = 0; bit < 8; bit++) {
      uint8_t mix = (uint8_t)((crc ^ (data[i] >> bit)) & 1);
      crc = (uint8_t)((crc >> 1) ^ (mix ? 0x8C : 0));
    }
  return crc;
}

/* The line as the processor sees it: its own port forgets the pull-up while it holds the line low. */
static void set_line(void) { avr_raise_irq(dq_irq, !master_low && !held_low); }

static avr_cycle_count_t let_go(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
  (void)avr;
  (void)when;
  (void)parameter;
  held_low = 0;
  set_line();
  return 0;
}

static avr_cycle_count_t be_present(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
  (void)when;
  (void)parameter;
  held_low = 1;
  set_line();
  avr_cycle_timer_register(avr, cycles_of(bench, 120e-6), let_go, NULL);
  return 0;
}

static void convert(void)
{
  int16_t sixteenths = (int16_t)lround(celsius * 16.0);
  scratch[0] = (uint8_t)sixteenths;
  scratch[1] = (uint8_t)(sixteenths >> 8);
  scratch[2] = 0x4B, scratch[3] = 0x46, scratch[4] = 0x7F, scratch[5] = 0xFF, scratch[6] = 0x0C, scratch[7] = 0x10;
  scratch[8] = crc8(scratch, 8);
}

static void heard(uint8_t command)
{
  if (state == ROM) {
    state = command == SKIP_ROM ? FUNCTION : NOBODY;
  } else if (state == FUNCTION && command == CONVERT) {
    convert();
    state = NOBODY;
  } else if (state == FUNCTION && command == READ_SCRATCH) {
    state = SENDING;
    out_at = out_bit = 0;
  } else {
    state = NOBODY;
  }
}

static void went_low(void)
{
  low_since = bench->avr->cycle;
  if (state == SENDING && out_at < sizeof scratch) {
    if (!((scratch[out_at] >> out_bit) & 1)) {
      held_low = 1;
      avr_cycle_timer_register(bench->avr, cycles_of(bench, HOLD_S), let_go, NULL);
    }
    if (++out_bit == 8) {
      out_bit = 0;
      out_at++;
    }
  }
}

static void was_freed(void)
{
  double low_s = true_s(bench, bench->avr->cycle) - true_s(bench, low_since);
  if (low_s >= RESET_S) {
    state = ROM;
    byte = bits = 0;
    avr_cycle_timer_register(bench->avr, cycles_of(bench, 30e-6), be_present, NULL);
  } else if (state == ROM || state == FUNCTION) {
    byte = (uint8_t)(byte >> 1 | (low_s < ONE_S ? 0x80 : 0));
    if (++bits == 8) {
      uint8_t whole = byte;
      byte = bits = 0;
      heard(whole);
    }
  }
}

static void direction_changed(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
  (void)irq;
  (void)parameter;
  int low = (value >> DQ_PIN) & 1;
  if (low == master_low)
    return;
  master_low = low;
  if (low)
    went_low();
  else
    was_freed();
  set_line();
}

void thermometer_attach(struct bench *at, double temperature)
{
  bench = at;
  celsius = temperature;
  scratch[0] = 0x50, scratch[1] = 0x05; /* 85 degC before the first conversion */
  scratch[5] = 0xFF;
  scratch[8] = crc8(scratch, 8);
  dq_irq = avr_io_getirq(at->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), DQ_PIN);
  set_line(); /* its pull-up */
  avr_irq_register_notify(avr_io_getirq(at->avr, AVR_IOCTL_IOPORT_GETIRQ('D'), IOPORT_IRQ_DIRECTION_ALL),
                          direction_changed, NULL);
}
