/* The HC-SR04 and the bob over it.
 *
 * A pulse on TRIG of 10 us or more, and at its end a burst; 450 us after that ECHO goes up, and it falls when the first
 * echo comes back, or after 38 ms where none does. A pulse on TRIG meanwhile does nothing. Times are those that sheets
 * and oscillograms of such modules show; which module does what else, only hardware tells.
 */
#include <math.h>

#include <avr_ioport.h>
#include <sim_cycle_timers.h>

#include "bench.h"

#define BURST_S 450e-6
#define SHORTEST_PULSE_S 10e-6
#define WAVE_S 25e-6 /* of 40 kHz */

enum { ECHO_PIN = 0, TRIG_PIN = 1 };

static struct bench *bench;
static struct transducer how;
static avr_irq_t *echo_irq;

/* The latest pulse on TRIG, as it goes into the log when the next comes. */
static struct {
  int there;
  avr_cycle_count_t rise, fall, echo_up, echo_down;
  const char *kind;
  double flight_us;
} latest;

static int trig_up, echo_up, busy;
static double fall_after_s; /* from ECHO going up */
static double up_before_s;  /* when ECHO went up for the ping before, true time */
static double up_s = -1.0;
static int noted;           /* whether ECHO belongs to the latest pulse */

static int within(struct span span, double t) { return t >= span.from_s && t < span.to_s; }

static void set_echo(int up)
{
  if (up == echo_up)
    return;
  echo_up = up;
  avr_raise_irq(echo_irq, (uint32_t)up);
  if (noted && up && !latest.echo_up)
    latest.echo_up = bench->avr->cycle;
  else if (noted && !up && latest.echo_up && !latest.echo_down)
    latest.echo_down = bench->avr->cycle;
}

static avr_cycle_count_t echo_falls(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
  (void)when;
  (void)parameter;
  if (within(how.stuck, true_s(bench, avr->cycle)))
    return avr->cycle + cycles_of(bench, 1e-3); /* not before that is over */
  set_echo(0);
  busy = 0;
  return 0;
}

static double position_m(double t)
{
  return how.rest_m + how.amplitude_m * exp(-how.damping_per_s * t) * cos(2.0 * M_PI * t / how.period_s);
}

/* Time of flight of sound that leaves at a moment: it meets the bob half way. */
static double flight_s(double t)
{
  double flight = 2.0 * position_m(t) / how.sound_m_per_s;
  for (int i = 0; i < 4; i++)
    flight = 2.0 * position_m(t + 0.5 * flight) / how.sound_m_per_s;
  return flight;
}

static void choose_echo(double t)
{
  double noise = 2.0 * how.noise_m * chance_normal() / how.sound_m_per_s;
  double flight = flight_s(t) + noise, draw = chance_uniform(), side = chance_uniform();
  double ghost = up_before_s + how.ghost_us * 1e-6 - t;
  latest.kind = "echo";
  if (within(how.gone, t) || draw < how.lost) {
    latest.kind = "lost";
    flight = how.lost_us * 1e-6;
  } else if ((draw -= how.lost) < how.late) {
    latest.kind = "late";
    flight = how.late_us * 1e-6;
  } else if ((draw -= how.late) < how.ghost && ghost > 0.0 && ghost < flight) {
    latest.kind = "ghost"; /* sound of the ping before, on a longer way, comes first */
    flight = ghost;
  } else if ((draw -= how.ghost) >= 0.0 && draw < how.slip) {
    latest.kind = side < 0.5 ? "early-wave" : "late-wave";
    flight += side < 0.5 ? -WAVE_S : WAVE_S;
  }
  latest.flight_us = flight * 1e6;
  fall_after_s = flight;
}

static avr_cycle_count_t echo_rises(avr_t *avr, avr_cycle_count_t when, void *parameter)
{
  (void)when;
  (void)parameter;
  double t = true_s(bench, avr->cycle);
  choose_echo(t);
  up_before_s = up_s = t;
  set_echo(1);
  avr_cycle_timer_register(avr, cycles_of(bench, fall_after_s), echo_falls, NULL);
  return 0;
}

static void log_latest(void)
{
  if (!latest.there || !bench->log)
    return;
  fprintf(bench->log, "P %llu %llu %s %.4f %llu %llu\n", (unsigned long long)latest.rise, (unsigned long long)latest.fall,
          latest.kind, latest.flight_us, (unsigned long long)latest.echo_up, (unsigned long long)latest.echo_down);
}

static void triggered(void)
{
  avr_t *avr = bench->avr;
  double t = true_s(bench, avr->cycle);
  if (true_s(bench, latest.fall) - true_s(bench, latest.rise) < SHORTEST_PULSE_S) {
    latest.kind = "too-short";
  } else if (within(how.absent, t)) {
    latest.kind = "absent";
  } else if (within(how.stuck, t)) {
    latest.kind = "stuck";
    if (!busy) {
      busy = 1;
      set_echo(1);
      avr_cycle_timer_register(avr, cycles_of(bench, 1e-3), echo_falls, NULL);
    }
  } else if (busy && !how.retriggers) {
    latest.kind = "ignored";
  } else {
    if (busy) {
      avr_cycle_timer_cancel(avr, echo_falls, NULL);
      avr_cycle_timer_cancel(avr, echo_rises, NULL);
      set_echo(0);
    }
    busy = 1;
    noted = 1;
    avr_cycle_timer_register(avr, cycles_of(bench, BURST_S), echo_rises, NULL);
  }
}

static void trig_changed(struct avr_irq_t *irq, uint32_t value, void *parameter)
{
  (void)irq;
  (void)parameter;
  int up = value & 1;
  if (up == trig_up)
    return;
  trig_up = up;
  if (up) {
    log_latest();
    latest.there = 1;
    latest.rise = bench->avr->cycle;
    latest.kind = "rising";
    latest.flight_us = 0.0;
    latest.echo_up = latest.echo_down = 0;
    noted = 0;
  } else if (latest.there) {
    latest.fall = bench->avr->cycle;
    triggered();
  }
}

void transducer_attach(struct bench *at, const struct transducer *wanted)
{
  bench = at;
  how = *wanted;
  echo_irq = avr_io_getirq(at->avr, AVR_IOCTL_IOPORT_GETIRQ('B'), ECHO_PIN);
  avr_irq_register_notify(avr_io_getirq(at->avr, AVR_IOCTL_IOPORT_GETIRQ('B'), TRIG_PIN), trig_changed, NULL);
  avr_raise_irq(echo_irq, 0);
}

void transducer_end(void)
{
  if (latest.there && latest.fall > latest.rise)
    log_latest();
}
