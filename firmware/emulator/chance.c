/* Chance that a seed repeats: splitmix64 (Steele, Lea, Flood 2014, doi:10.1145/2660193.2660195), Box and Muller. */
#include <math.h>

#include "bench.h"

static uint64_t state;

void chance_seed(uint64_t seed) { state = seed; }

static uint64_t next(void)
{
  uint64_t z = state += 0x9E3779B97F4A7C15ULL;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
  return z ^ (z >> 31);
}

double chance_uniform(void) { return (double)(next() >> 11) * 0x1p-53; }

double chance_normal(void)
{
  double radius = sqrt(-2.0 * log(1.0 - chance_uniform()));
  return radius * cos(2.0 * M_PI * chance_uniform());
}
