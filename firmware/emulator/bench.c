/* Runs the firmware at a bench that is not there: as fast as it goes, or in real time behind a pseudo-terminal. */
#include <fcntl.h>
#include <getopt.h>
#include <math.h>
#include <pty.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <termios.h>
#include <time.h>
#include <unistd.h>

#include "bench.h"

#define WDTCSR 0x60
#define PACE_S 0.5e-3

static volatile sig_atomic_t ended;

static void end(int signal_number)
{
  (void)signal_number;
  ended = 1;
}

double true_s(const struct bench *bench, avr_cycle_count_t cycle)
{
  return (double)cycle / (CPU_HZ * (1.0 + bench->clock_ppm * 1e-6));
}

avr_cycle_count_t cycles_of(const struct bench *bench, double seconds)
{
  return (avr_cycle_count_t)llround(seconds * CPU_HZ * (1.0 + bench->clock_ppm * 1e-6));
}

static const char usage[] =
    "bench FIRMWARE.elf [--seconds S] [--log FILE] [--pty LINK] [--seed N] [--clock-ppm X]\n"
    "  the bob:     --rest M --amplitude M --period S --damping 1/S --noise M --sound M/S --temperature C\n"
    "  each ping:   --lost P --late P --ghost P --slip P (chances) --lost-us --late-us --ghost-us --retriggers\n"
    "  for a while: --absent FROM,TO --stuck FROM,TO --gone FROM,TO (s)\n"
    "  to the port: --say S,COMMAND (again for more, in order) --random-bytes S,COUNT\n"
    "Writes a line of --log for each pulse on TRIG (P up down kind flight_us echo_up echo_down, cycles of the\n"
    "processor; 0 where it did not come) and each line of the port (U end_cycle bytes).\n";

enum option_code {
  SECONDS = 256, LOG, PTY, SEED, CLOCK, REST, AMPLITUDE, PERIOD, DAMPING, NOISE, SOUND, TEMPERATURE, LOST, LATE, GHOST,
  SLIP, LOST_US, LATE_US, GHOST_US, RETRIGGERS, ABSENT, STUCK, GONE, SAY, RANDOM_BYTES
};

static const struct option options[] = {
    {"seconds", 1, 0, SECONDS},   {"log", 1, 0, LOG},           {"pty", 1, 0, PTY},
    {"seed", 1, 0, SEED},         {"clock-ppm", 1, 0, CLOCK},   {"rest", 1, 0, REST},
    {"amplitude", 1, 0, AMPLITUDE}, {"period", 1, 0, PERIOD},   {"damping", 1, 0, DAMPING},
    {"noise", 1, 0, NOISE},       {"sound", 1, 0, SOUND},       {"temperature", 1, 0, TEMPERATURE},
    {"lost", 1, 0, LOST},         {"late", 1, 0, LATE},         {"ghost", 1, 0, GHOST},
    {"slip", 1, 0, SLIP},         {"lost-us", 1, 0, LOST_US},   {"late-us", 1, 0, LATE_US},
    {"ghost-us", 1, 0, GHOST_US}, {"retriggers", 0, 0, RETRIGGERS}, {"absent", 1, 0, ABSENT},
    {"stuck", 1, 0, STUCK},       {"gone", 1, 0, GONE},         {"say", 1, 0, SAY},
    {"random-bytes", 1, 0, RANDOM_BYTES}, {0, 0, 0, 0}};

static void fail(const char *why)
{
  fprintf(stderr, "bench: %s\n%s", why, usage);
  exit(2);
}

static double number(const char *text, char **end_of_it)
{
  char *stop;
  double value = strtod(text, &stop);
  if (stop == text || (!end_of_it && *stop))
    fail("a number was expected");
  if (end_of_it)
    *end_of_it = stop;
  return value;
}

static struct span span_of(const char *text)
{
  char *stop;
  double from = number(text, &stop);
  if (*stop != ',')
    fail("FROM,TO was expected");
  return (struct span){from, number(stop + 1, NULL)};
}

/* The pseudo-terminal's other end gets a name of the caller's choice: two benches never meet. */
static int open_terminal(const char *link)
{
  int master, slave;
  char name[128];
  struct termios raw;
  if (openpty(&master, &slave, name, NULL, NULL) < 0 || tcgetattr(slave, &raw) < 0) {
    perror("bench: pseudo-terminal");
    exit(1);
  }
  cfmakeraw(&raw);
  tcsetattr(slave, TCSANOW, &raw);
  close(slave); /* with nobody at the other end, what is sent is lost and not kept for later */
  fcntl(master, F_SETFL, O_NONBLOCK);
  if (symlink(name, link) < 0) {
    perror(link);
    exit(1);
  }
  return master;
}

static double monotonic_s(void)
{
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Wait for real time to come up with the emulator's; a machine that was too slow is not caught up with in a rush. */
static void keep_pace(const struct bench *bench, double *start_s)
{
  uart_listen();
  double ahead = *start_s + true_s(bench, bench->avr->cycle) - monotonic_s();
  if (ahead > 0.0)
    nanosleep(&(struct timespec){0, (long)(fmin(ahead, 0.5) * 1e9)}, NULL);
  else if (ahead < -0.25)
    *start_s -= ahead;
}

int main(int argc, char **argv)
{
  struct bench bench = {0};
  struct transducer how = {.rest_m = 0.35, .amplitude_m = 0.05, .period_s = 0.79, .damping_per_s = 0.01,
                           .noise_m = 80e-6, .sound_m_per_s = 344.0, .lost_us = 38000.0, .late_us = 12000.0,
                           .ghost_us = 11200.0};
  double seconds = INFINITY, celsius = NAN, noise_from = 0.0, say_at[64];
  const char *link = NULL, *say_what[64];
  uint32_t noise_bytes = 0;
  size_t says = 0;
  char *stop;
  chance_seed(1);
  for (int code; (code = getopt_long(argc, argv, "", options, NULL)) != -1;) {
    switch (code) {
    case SECONDS: seconds = number(optarg, NULL); break;
    case LOG: bench.log = fopen(optarg, "w"); if (!bench.log) { perror(optarg); return 1; } break;
    case PTY: link = optarg; break;
    case SEED: chance_seed((uint64_t)number(optarg, NULL)); break;
    case CLOCK: bench.clock_ppm = number(optarg, NULL); break;
    case REST: how.rest_m = number(optarg, NULL); break;
    case AMPLITUDE: how.amplitude_m = number(optarg, NULL); break;
    case PERIOD: how.period_s = number(optarg, NULL); break;
    case DAMPING: how.damping_per_s = number(optarg, NULL); break;
    case NOISE: how.noise_m = number(optarg, NULL); break;
    case SOUND: how.sound_m_per_s = number(optarg, NULL); break;
    case TEMPERATURE: celsius = number(optarg, NULL); break;
    case LOST: how.lost = number(optarg, NULL); break;
    case LATE: how.late = number(optarg, NULL); break;
    case GHOST: how.ghost = number(optarg, NULL); break;
    case SLIP: how.slip = number(optarg, NULL); break;
    case LOST_US: how.lost_us = number(optarg, NULL); break;
    case LATE_US: how.late_us = number(optarg, NULL); break;
    case GHOST_US: how.ghost_us = number(optarg, NULL); break;
    case RETRIGGERS: how.retriggers = 1; break;
    case ABSENT: how.absent = span_of(optarg); break;
    case STUCK: how.stuck = span_of(optarg); break;
    case GONE: how.gone = span_of(optarg); break;
    case SAY:
      if (says == sizeof say_at / sizeof *say_at)
        fail("at most 64 --say");
      say_at[says] = number(optarg, &stop);
      if (*stop != ',')
        fail("--say takes SECONDS,COMMAND");
      say_what[says++] = stop + 1;
      break;
    case RANDOM_BYTES:
      noise_from = number(optarg, &stop);
      if (*stop != ',')
        fail("--random-bytes takes SECONDS,COUNT");
      noise_bytes = (uint32_t)number(stop + 1, NULL);
      break;
    default: fail("unknown option");
    }
  }
  if (optind != argc - 1)
    fail("one FIRMWARE.elf was expected");
  bench.avr = processor_start(argv[optind]);
  int terminal = link ? open_terminal(link) : -1;
  uart_attach(&bench, terminal);
  transducer_attach(&bench, &how);
  if (!isnan(celsius))
    thermometer_attach(&bench, celsius);
  for (size_t i = 0; i < says; i++)
    uart_say_at(say_at[i], say_what[i]);
  if (noise_bytes)
    uart_noise_at(noise_from, noise_bytes);
  signal(SIGINT, end);
  signal(SIGTERM, end);
  double start_s = monotonic_s();
  avr_cycle_count_t pace = 0, last = isfinite(seconds) ? cycles_of(&bench, seconds) : (avr_cycle_count_t)-1;
  int state = cpu_Running;
  while (!ended && bench.avr->cycle < last && state != cpu_Done && state != cpu_Crashed) {
    state = avr_run(bench.avr);
    if (link && bench.avr->cycle >= pace) {
      keep_pace(&bench, &start_s);
      pace = bench.avr->cycle + cycles_of(&bench, PACE_S);
    }
  }
  transducer_end();
  if (bench.log)
    fclose(bench.log);
  if (link)
    unlink(link);
  printf("cycles %llu ram %d watchdog %d all_said %d\n", (unsigned long long)bench.avr->cycle,
         processor_ram_used(bench.avr), bench.avr->data[WDTCSR], uart_silent());
  if (state == cpu_Crashed || state == cpu_Done) {
    fprintf(stderr, "bench: the firmware came to an end, which it never should\n");
    return 1;
  }
  return 0;
}
