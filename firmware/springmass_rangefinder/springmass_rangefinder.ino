/* An ultrasonic rangefinder that reads at 100 Hz and speaks the springmass line protocol.
 *
 * Board:  ATmega328P at 16 MHz (Arduino Uno, Nano), transducer HC-SR04 or alike.
 * Wiring: TRIG on D9 (PB1), ECHO on D8 (PB0 = ICP1, the timer's capture pin; no other will do), 5 V, ground.
 * Port:   115200 baud, 8N1. Protocol: docs/reference/line-protocol.md.
 *
 * The echo is timed by the capture unit of timer 1, not by software: 62.5 ns a tick, sent in steps of 0.25 us, which
 * is 43 um of distance. What limits a reading is then the transducer, which triggers on one wave of 25 us or the
 * next, and not the clock. device_us is stamped at the trigger, so jitter of this loop does not enter a time.
 *
 * A line goes out for every period, with or without an echo: a missing number in the sequence is a lost line.
 * HC-SR04 hold ECHO high for 38 ms or more when they heard nothing; until it falls, lines carry status B.
 *
 * Builds in the Arduino IDE, or alone:
 *   avr-gcc -mmcu=atmega328p -DF_CPU=16000000UL -Os -Wall -Wextra -x c springmass_rangefinder.ino -o rangefinder.elf
 */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <stdint.h>
#include <stdlib.h>
#include <util/crc16.h>
#include <util/delay.h>

#define PERIOD_US 10000UL      /* 100 Hz */
#define LISTEN_US 9500UL       /* an echo later than this is none: 1.6 m */
#define TICKS_PER_US 16UL
#define TICKS_PER_STEP 4UL     /* 0.25 us */
#define NO_TEMPERATURE (-32768)

#define TRIG _BV(PB1)
#define ECHO _BV(PB0)

/* ---- Time: timer 1 runs at the full clock, its overflows are counted. ---- */

static volatile uint32_t overflows;

ISR(TIMER1_OVF_vect) { overflows++; }

/* With interrupts off. An overflow that waits for its interrupt belongs to a small count, not to a large one. */
static uint32_t overflows_at(uint16_t count)
{
  return overflows + ((TIFR1 & _BV(TOV1)) && count < 0x8000 ? 1 : 0);
}

/* Microseconds since the start; wraps at 2^32 as the protocol says (65536 ticks are 4096 us exactly). */
static uint32_t now_us(void)
{
  uint8_t saved = SREG;
  cli();
  uint16_t count = TCNT1;
  uint32_t us = (overflows_at(count) << 12) + count / TICKS_PER_US;
  SREG = saved;
  return us;
}

/* ---- Echo: the capture unit stores the count at each edge. ---- */

enum echo_state { IDLE, WAIT_RISE, WAIT_FALL, DONE };

static volatile uint8_t echo_state = IDLE;
static volatile uint32_t echo_rise, echo_ticks;

static void capture_on(uint8_t rising)
{
  if (rising)
    TCCR1B |= _BV(ICES1);
  else
    TCCR1B &= (uint8_t)~_BV(ICES1);
  TIFR1 = _BV(ICF1); /* changing the edge may set the flag */
}

ISR(TIMER1_CAPT_vect)
{
  uint16_t count = ICR1;
  uint32_t ticks = (overflows_at(count) << 16) | count;
  if (echo_state == WAIT_RISE) {
    echo_rise = ticks;
    capture_on(0);
    echo_state = WAIT_FALL;
  } else if (echo_state == WAIT_FALL) {
    echo_ticks = ticks - echo_rise;
    echo_state = DONE;
  }
}

/* ---- Serial: lines wait in a ring while the next ping is timed. ---- */

#define RING 128 /* two lines; a power of two */

static volatile char ring[RING];
static volatile uint8_t ring_head, ring_tail;

ISR(USART_UDRE_vect)
{
  if (ring_head == ring_tail) {
    UCSR0B &= (uint8_t)~_BV(UDRIE0);
    return;
  }
  UDR0 = ring[ring_tail];
  ring_tail = (ring_tail + 1) % RING;
}

static void put(char c)
{
  uint8_t next = (ring_head + 1) % RING;
  while (next == ring_tail)
    ; /* 115200 baud carry three such lines in a period: this waits only behind a greeting */
  ring[ring_head] = c;
  ring_head = next;
  UCSR0B |= _BV(UDRIE0);
}

static uint16_t crc;

/* Send a character that the checksum covers. */
static void put_checked(char c)
{
  crc = _crc_xmodem_update(crc, (uint8_t)c); /* polynomial 1021; begun with FFFF it is CRC-16/CCITT-FALSE */
  put(c);
}

static void put_text(const char *text)
{
  while (*text)
    put_checked(*text++);
}

static void put_number(uint32_t value)
{
  char digits[11];
  put_text(ultoa(value, digits, 10));
}

static void put_hex(uint8_t nibble) { put(nibble < 10 ? '0' + nibble : 'A' + nibble - 10); }

/* ---- The protocol ---- */

/* Centidegrees Celsius, or NO_TEMPERATURE. Read your sensor here; it must return at once. */
static int16_t temperature_cc(void) { return NO_TEMPERATURE; }

static void send_line(uint32_t sequence, uint32_t at_us, uint32_t ticks, char status)
{
  uint32_t steps = (ticks + TICKS_PER_STEP / 2) / TICKS_PER_STEP;
  int16_t temperature = temperature_cc();
  crc = 0xFFFF;
  put('$');
  put_text("R1,");
  put_number(sequence);
  put_checked(',');
  put_number(at_us);
  put_checked(',');
  if (status == 'E') {
    static const char *const quarters[] = {".00", ".25", ".50", ".75"};
    put_number(steps / 4);
    put_text(quarters[steps % 4]);
  }
  put_checked(',');
  if (temperature != NO_TEMPERATURE) {
    if (temperature < 0)
      put_checked('-');
    put_number(temperature < 0 ? (uint32_t)(-(int32_t)temperature) : (uint32_t)temperature);
  }
  put_checked(',');
  put_checked(status);
  put('*');
  put_hex(crc >> 12);
  put_hex((crc >> 8) & 15);
  put_hex((crc >> 4) & 15);
  put_hex(crc & 15);
  put('\n');
}

static void greet(void)
{
  const char *text = "# springmass rangefinder, line protocol R1, 100 Hz\n";
  while (*text)
    put(*text++);
}

/* ---- Arduino's two functions ---- */

static uint32_t sequence, next_us;

void setup(void)
{
  DDRB = (DDRB | TRIG) & (uint8_t)~ECHO;
  PORTB &= (uint8_t)~(TRIG | ECHO);
  TCCR1A = 0;
  TCCR1B = _BV(ICNC1) | _BV(CS10); /* noise canceller (four equal ticks), no prescaler */
  TIMSK1 = _BV(TOIE1) | _BV(ICIE1);
  UCSR0A = _BV(U2X0);
  UBRR0 = 16; /* 117647 baud: 2.1 % fast, within what 8N1 bears, and what the Arduino core sets too */
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(TXEN0);
  sei();
  greet();
  next_us = now_us() + PERIOD_US;
}

void loop(void)
{
  while ((int32_t)(now_us() - next_us) < 0)
    ;
  next_us += PERIOD_US; /* from the schedule, not from now: delays do not add up */

  uint32_t at_us = now_us();
  if (PINB & ECHO) { /* the echo pin is still up from a ping that heard nothing */
    send_line(sequence++, at_us, 0, 'B');
    return;
  }

  cli();
  capture_on(1);
  echo_state = WAIT_RISE;
  sei();
  PORTB |= TRIG;
  at_us = now_us();
  _delay_us(10);
  PORTB &= (uint8_t)~TRIG;

  while (echo_state != DONE && now_us() - at_us < LISTEN_US)
    ;
  cli();
  uint8_t heard = echo_state == DONE;
  uint32_t ticks = echo_ticks;
  echo_state = IDLE;
  sei();
  send_line(sequence++, at_us, ticks, heard ? 'E' : 'N');
}

#ifndef ARDUINO
int main(void)
{
  setup();
  for (;;)
    loop();
}
#endif
