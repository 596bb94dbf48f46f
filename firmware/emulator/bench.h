/* A bench without hardware: an ATmega328P in simavr that runs the rangefinder's firmware, and what is wired to it. */
#ifndef BENCH_H
#define BENCH_H

#include <stdint.h>
#include <stdio.h>

#include <sim_avr.h>

#define CPU_HZ 16e6

struct bench {
  avr_t *avr;
  FILE *log;       /* what truly happened, a line each; NULL: nobody asks */
  double clock_ppm; /* how much faster the resonator runs than it says */
};

/* Seconds of true time; the emulator counts the resonator's cycles. */
double true_s(const struct bench *bench, avr_cycle_count_t cycle);
avr_cycle_count_t cycles_of(const struct bench *bench, double seconds);

/* chance.c: numbers that the seed alone decides */
void chance_seed(uint64_t seed);
double chance_uniform(void); /* 0 to 1 */
double chance_normal(void);

/* processor.c: the emulator, with what it lacks put right */
avr_t *processor_start(const char *elf);
int processor_ram_used(const avr_t *avr); /* bytes of RAM that data and stack have ever taken */

/* transducer.c: the HC-SR04 and the bob over it */
struct span { double from_s, to_s; };

struct transducer {
  double rest_m, amplitude_m, period_s, damping_per_s, noise_m, sound_m_per_s;
  double lost, late, ghost, slip; /* chance of each, for every ping */
  double lost_us, late_us, ghost_us;
  struct span absent, stuck, gone; /* no module, ECHO held up, no target */
  int retriggers;                  /* takes a new ping while it still listens for the last */
};

void transducer_attach(struct bench *bench, const struct transducer *how);
void transducer_end(void); /* log the last ping */

/* thermometer.c: the DS18B20 */
void thermometer_attach(struct bench *bench, double celsius);

/* uart.c: the serial line, to a log, a terminal, or both */
void uart_attach(struct bench *bench, int terminal);
void uart_say_at(double seconds, const char *text);             /* a command and its line feed */
void uart_noise_at(double seconds, uint32_t bytes);             /* so many random bytes at the speed of the line */
int uart_silent(void);                                          /* whether all that was to be said has been said */
void uart_listen(void);                                         /* take what came over the terminal */

#endif
