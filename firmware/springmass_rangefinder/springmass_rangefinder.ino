/* An ultrasonic rangefinder with 10 to 125 readings per second, which uses the springmass line protocol.
 *
 * Board:  ATmega328P at 16 MHz and 5 V (Arduino Uno, Nano), transducer HC-SR04 or similar.
 * Wiring: TRIG on D9 (OC1A), ECHO on D8 (ICP1), 5 V, ground; these are the pins of the timer, others do not work.
 *         Optional, a DS18B20 thermometer: DQ on D2 with 4.7 kOhm to 5 V, 5 V, ground.
 * Port:   115200 baud, 8N1. Protocol and commands: docs/reference/line-protocol.md.
 * Build:  open it in the Arduino IDE and press Upload, or `make firmware`; `springmass firmware --flash` needs neither.
 *
 * The measurement does not depend on software delays. Timer 1 switches TRIG at the planned tick, and stores the tick of
 * each edge of ECHO. A tick is 62.5 ns; times are sent in steps of 0.25 us, which is 43 um of distance. The accuracy is
 * limited by the transducer, which may detect one wave of 25 us or the next, and not by the clock.
 *
 * Every period sends a line, with or without an echo, so a missing sequence number means a lost line. The watchdog
 * stays off, because the bootloader of older Nanos does not stop it and would restart for ever.
 */
#include <avr/eeprom.h>
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <util/crc16.h>
#include <util/delay.h>

#define VERSION "2.0.0"

#define TRIG _BV(PB1)
#define ECHO _BV(PB0)
#define DQ _BV(PD2)

#define TICKS_PER_US 16UL
#define TICKS_PER_STEP 4UL /* 0.25 us */
#define PULSE_TICKS (40 * TICKS_PER_US) /* the modules ask for 10 us or more; other interrupts may take 20 */
#define SOON_TICKS (20 * TICKS_PER_US)
#define LATE_US 300UL     /* a ping is planned at least this long ahead */
#define INSIST_US 80000UL /* while ECHO is high, trigger again for at most this long */
#define STUCK_US 250000UL /* a working module never holds ECHO high for so long */
#define IDENTIFY_US 5000000UL

#define RATE_HZ_LEAST 10
#define RATE_HZ_MOST 125
#define BLANK_US 116 /* 2 cm: the transducer still rings */
#define FAR_US 25000U /* 4.3 m; an HC-SR04 ends its pulse after 38 ms if there was no echo */
#define FAR_US_MOST 30000U
#define SPREAD_US_MOST 2000
#define NAME_BYTES 12
#define NO_TEMPERATURE (-32768)

/* The settings; they are stored in the EEPROM, because opening the port restarts most boards. */
struct settings {
  uint8_t version;
  uint8_t rate_hz;
  uint16_t near_us, far_us; /* the gate: times of flight that count as an echo */
  uint16_t spread_us;       /* each ping is later by a random time up to this */
  char name[NAME_BYTES + 1];
  uint8_t check;
};

/* The result of a ping. */
enum ping_state { CLOSED, WAIT_RISE, WAIT_FALL, BUSY, DONE };

struct ping {
  uint32_t sequence, at_us;
  uint32_t echo_ticks;
  uint8_t state;
  uint8_t was_busy;  /* ECHO was high from an earlier ping when this one was sent */
  uint8_t too_close; /* a pulse shorter than the gate was ignored */
};

enum trigger_state { RESTING, WAITING, HIGH_NOW };

static struct settings settings;

/* ---- Time: timer 1 runs at the full clock, its overflows are counted. ---- */

static volatile uint32_t overflows;

ISR(TIMER1_OVF_vect) { overflows++; }

/* Call with interrupts off. A pending overflow belongs to a small count, not to a large one. */
static uint32_t overflows_at(uint16_t count)
{
  return overflows + ((TIFR1 & _BV(TOV1)) && count < 0x8000 ? 1 : 0);
}

/* Microseconds since the start; wraps at 2^32 as in the protocol (65536 ticks are exactly 4096 us). */
static uint32_t now_us(void)
{
  uint8_t saved = SREG;
  cli();
  uint16_t count = TCNT1;
  uint32_t us = (overflows_at(count) << 12) + count / TICKS_PER_US;
  SREG = saved;
  return us;
}

/* ---- Ping and echo: compare unit A drives TRIG, the capture unit stores the count at each edge of ECHO. ---- */

static volatile struct ping ping;   /* the current ping */
static volatile struct ping closed; /* the ping whose line is due */
static volatile uint8_t closed_waits;

static volatile uint8_t trigger_state = RESTING;
static volatile uint8_t laps;  /* rounds of the timer before the ping */
static volatile uint8_t quiet; /* the next ping is not triggered */
static volatile uint32_t next_sequence, next_us;
static volatile uint32_t high_since_us; /* time of the ping during which ECHO went high and stayed */

static uint32_t echo_rise;

/* The effect of a match on TRIG: none between two pings, when the port holds it low. */
#define ON_MATCH_NOTHING 0
#define ON_MATCH_CLEAR _BV(COM1A1)
#define ON_MATCH_SET (_BV(COM1A1) | _BV(COM1A0))

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
  switch (ping.state) {
  case WAIT_RISE:
    echo_rise = ticks;
    ping.state = WAIT_FALL;
    capture_on(0);
    break;
  case WAIT_FALL:
    ping.echo_ticks = ticks - echo_rise;
    if (ping.echo_ticks < settings.near_us * TICKS_PER_US) { /* ring-down or a spike: the echo may still come */
      ping.too_close = 1;
      ping.state = WAIT_RISE;
      capture_on(1);
    } else {
      ping.state = DONE;
    }
    break;
  case BUSY: /* a module that accepts the ping raises ECHO again */
    ping.state = WAIT_RISE;
    capture_on(1);
    break;
  default:
    break;
  }
}

/* With interrupts off. */
static void close_ping(void)
{
  closed.sequence = ping.sequence;
  closed.at_us = ping.at_us;
  closed.echo_ticks = ping.echo_ticks;
  closed.was_busy = ping.was_busy;
  closed.too_close = ping.too_close;
  closed.state = ping.state;
  closed_waits = 1;
  ping.state = CLOSED;
}

/* At the moment of a ping, with interrupts off. */
static void begin_ping(void)
{
  uint8_t before = ping.state;
  uint8_t up = PINB & ECHO;
  if (before != CLOSED)
    close_ping();
  if (up && before != WAIT_FALL && before != BUSY)
    high_since_us = next_us;
  else if (up && before == WAIT_FALL)
    high_since_us = closed.at_us;
  ping.sequence = next_sequence;
  ping.at_us = next_us;
  ping.too_close = 0;
  ping.was_busy = up || quiet;
  ping.state = up ? BUSY : WAIT_RISE;
  capture_on(!up);
}

ISR(TIMER1_COMPA_vect)
{
  if (trigger_state == WAITING && laps) {
    if (--laps == 0 && !quiet)
      TCCR1A = ON_MATCH_SET;
    return;
  }
  if (trigger_state == WAITING) { /* TRIG went up at this match */
    uint16_t fall = OCR1A + PULSE_TICKS;
    TCCR1A = ON_MATCH_CLEAR;
    OCR1A = fall;
    trigger_state = HIGH_NOW;
    if ((int16_t)(TCNT1 - fall) >= 0) /* the match that lowers it was missed, which should not happen */
      TCCR1C = _BV(FOC1A);
    begin_ping();
    return;
  }
  TCCR1A = ON_MATCH_NOTHING;
  trigger_state = RESTING;
  TIMSK1 &= (uint8_t)~_BV(OCIE1A);
}

static uint32_t grid_us;
static uint16_t chance = 0xACE1;

static uint16_t random_below(uint16_t limit)
{
  chance ^= chance << 7; /* xorshift, period 65535 */
  chance ^= chance >> 9;
  chance ^= chance << 8;
  return limit ? chance % limit : 0;
}

/* Plan the next ping; the timer does the rest. */
static void plan_ping(void)
{
  uint32_t period_us = (1000000UL + settings.rate_hz / 2) / settings.rate_hz;
  uint32_t at_us;
  grid_us += period_us; /* from the schedule, not from now: delays do not add up */
  at_us = grid_us + random_below(settings.spread_us);
  if ((int32_t)(at_us - now_us()) < (int32_t)LATE_US)
    grid_us = at_us = now_us() + period_us; /* after a change of the rate */
  for (;;) {
    cli();
    uint16_t count = TCNT1;
    uint32_t ahead = at_us * TICKS_PER_US - ((overflows_at(count) << 16) | count);
    if ((uint16_t)ahead >= SOON_TICKS) {
      uint8_t up = ping.state == BUSY || ping.state == WAIT_FALL;
      OCR1A = (uint16_t)(at_us * TICKS_PER_US);
      TIFR1 = _BV(OCF1A);
      laps = ahead >> 16;
      quiet = up && ping.was_busy && at_us - high_since_us > INSIST_US;
      next_us = at_us;
      next_sequence++;
      TCCR1A = laps || quiet ? ON_MATCH_NOTHING : ON_MATCH_SET;
      trigger_state = WAITING;
      TIMSK1 |= _BV(OCIE1A);
      sei();
      return;
    }
    sei(); /* the timer is about to pass that count in an earlier round */
  }
}

/* Return whether a line is due: after the next ping has ended this one. If lines were sent at the echo, their delay
   would change with the distance of the bob, and the host would mistake that for an error of the clock. */
static uint8_t take_closed(struct ping *taken)
{
  uint8_t took = 0;
  cli();
  if (closed_waits) {
    taken->sequence = closed.sequence;
    taken->at_us = closed.at_us;
    taken->echo_ticks = closed.echo_ticks;
    taken->was_busy = closed.was_busy;
    taken->too_close = closed.too_close;
    taken->state = closed.state;
    closed_waits = 0;
    took = 1;
  }
  sei();
  return took;
}

static char status_of(const struct ping *p)
{
  switch (p->state) {
  case DONE:
    return p->echo_ticks <= settings.far_us * TICKS_PER_US ? 'E' : 'F';
  case WAIT_FALL:
    return 'N';
  case BUSY:
    return p->at_us - high_since_us > STUCK_US ? 'S' : 'B';
  default:
    return p->too_close ? 'C' : p->was_busy ? 'B' : 'A';
  }
}

/* ---- Serial out: lines wait in a ring while pings are timed. ---- */

#define LINE_ROOM 100           /* more than the longest line */
#define ANSWER_ROOM (2 * LINE_ROOM) /* so that an answer leaves room for a reading */

static volatile char ring[256]; /* its indices wrap by themselves */
static volatile uint8_t ring_head, ring_tail;

ISR(USART_UDRE_vect)
{
  if (ring_head == ring_tail) {
    UCSR0B &= (uint8_t)~_BV(UDRIE0);
    return;
  }
  UDR0 = ring[ring_tail++];
}

static uint8_t room(void) { return (uint8_t)(ring_tail - ring_head - 1); }

/* A line is written only if there is room for it, so this never waits. */
static void put(char c)
{
  ring[ring_head] = c;
  ring_head++;
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

static void put_flash(const char *text)
{
  char c;
  while ((c = pgm_read_byte(text++)))
    put_checked(c);
}

static void put_number(uint32_t value)
{
  char digits[11];
  put_text(ultoa(value, digits, 10));
}

static void put_field(uint32_t value)
{
  put_checked(',');
  put_number(value);
}

/* Always ten digits: with fewer at the start the lines would become longer and end later, and a host that compares the
   clocks would see an error of 17 ppm in half a minute. */
static void put_wide(uint32_t value)
{
  char digits[11];
  ultoa(value, digits, 10);
  put_checked(',');
  for (uint8_t zeros = 10 - strlen(digits); zeros; zeros--)
    put_checked('0');
  put_text(digits);
}

static void put_hex(uint8_t nibble) { put(nibble < 10 ? '0' + nibble : 'A' + nibble - 10); }

static void begin_line(void)
{
  crc = 0xFFFF;
  put('$');
}

static void end_line(void)
{
  put('*');
  for (int8_t shift = 12; shift >= 0; shift -= 4)
    put_hex((crc >> shift) & 15);
  put('\n');
}

/* ---- Thermometer: a DS18B20, a few slots of its bus at a time, never while a ping goes out. ---- */

#define CONVERT_US 800000UL
#define LOOK_AGAIN_US 2000000UL
#define POWER_ON (85 * 16) /* its value before the first measurement */

enum thermometer_step { LOOK, PRESENT, SKIP_FOR_CONVERT, CONVERT, SKIP_FOR_READ, READ, READING };

static uint8_t thermometer_step = LOOK, thermometer_wants_read;
static uint32_t thermometer_due_us, reset_us;
static uint8_t scratch[9], scratch_at;
static int16_t temperature_cc = NO_TEMPERATURE; /* centidegrees Celsius */

static void dq_low(void) { DDRD |= DQ; }
static void dq_free(void) { DDRD &= (uint8_t)~DQ; }

static uint8_t dq_bit(uint8_t bit)
{
  cli();
  dq_low();
  _delay_us(2);
  if (bit)
    dq_free();
  _delay_us(8);
  uint8_t read = PIND & DQ;
  sei();
  _delay_us(52);
  dq_free();
  _delay_us(3);
  return read != 0;
}

static uint8_t dq_byte(uint8_t byte)
{
  uint8_t read = 0;
  for (uint8_t i = 0; i < 8; i++)
    read |= dq_bit((byte >> i) & 1) << i;
  return read;
}

static void thermometer_failed(void)
{
  temperature_cc = NO_TEMPERATURE;
  thermometer_step = LOOK;
  thermometer_wants_read = 0;
  thermometer_due_us = now_us() + LOOK_AGAIN_US;
}

static void scratch_read(void)
{
  uint8_t check = 0;
  for (uint8_t i = 0; i < 8; i++)
    check = _crc_ibutton_update(check, scratch[i]);
  if (check != scratch[8] || scratch[5] != 0xFF) { /* a bus held low reads as zeros, whose checksum is zero */
    thermometer_failed();
    return;
  }
  int16_t sixteenths = (int16_t)(scratch[0] | scratch[1] << 8);
  if (sixteenths == POWER_ON) {
    thermometer_failed();
    return;
  }
  temperature_cc = (int16_t)((int32_t)sixteenths * 100 / 16);
}

/* Do one step of at most 0.7 ms, if one is due. */
static void thermometer(void)
{
  uint32_t now = now_us();
  if ((int32_t)(now - thermometer_due_us) < 0)
    return;
  if (thermometer_step == PRESENT) { /* DQ has been low for 480 us and more */
    if (now - reset_us < 480)
      return;
    cli();
    dq_free();
    _delay_us(5);
    uint8_t idle_high = PIND & DQ; /* without a pull-up there is no thermometer */
    sei();
    _delay_us(65);
    uint8_t present = idle_high && !(PIND & DQ);
    if (!present) {
      thermometer_failed();
      return;
    }
    thermometer_due_us = now + 600; /* the end of its presence pulse */
    thermometer_step = thermometer_wants_read ? SKIP_FOR_READ : SKIP_FOR_CONVERT;
    return;
  }
  switch (thermometer_step) {
  case LOOK:
    dq_low();
    reset_us = now;
    thermometer_step = PRESENT;
    break;
  case SKIP_FOR_CONVERT:
    dq_byte(0xCC);
    thermometer_step = CONVERT;
    break;
  case CONVERT:
    dq_byte(0x44);
    thermometer_wants_read = 1;
    thermometer_step = LOOK;
    thermometer_due_us = now + CONVERT_US;
    break;
  case SKIP_FOR_READ:
    dq_byte(0xCC);
    thermometer_step = READ;
    break;
  case READ:
    dq_byte(0xBE);
    scratch_at = 0;
    thermometer_step = READING;
    break;
  default:
    scratch[scratch_at++] = dq_byte(0xFF);
    if (scratch_at == sizeof scratch) {
      thermometer_wants_read = 0;
      thermometer_step = LOOK;
      scratch_read();
    }
  }
}

/* ---- The protocol ---- */

static volatile uint8_t identify; /* the identity must be sent */
static uint32_t identified_us;

static void send_reading(const struct ping *p)
{
  char status = status_of(p);
  if (room() < LINE_ROOM)
    return; /* impossible at 115200 baud; a missing sequence number would show it */
  begin_line();
  put_flash(PSTR("R1"));
  put_wide(p->sequence);
  put_wide(p->at_us);
  put_checked(',');
  if (status == 'E') {
    uint32_t steps = (p->echo_ticks + TICKS_PER_STEP / 2) / TICKS_PER_STEP;
    uint8_t hundredths = (steps & 3) * 25;
    put_number(steps >> 2);
    put_checked('.');
    put_checked('0' + hundredths / 10);
    put_checked('0' + hundredths % 10);
  }
  put_checked(',');
  if (temperature_cc != NO_TEMPERATURE) {
    if (temperature_cc < 0)
      put_checked('-');
    put_number(temperature_cc < 0 ? -temperature_cc : temperature_cc);
  }
  put_checked(',');
  put_checked(status);
  end_line();
}

static void send_identity(void)
{
  identify = 0;
  identified_us = now_us();
  begin_line();
  put_flash(PSTR("I1,springmass-rangefinder," VERSION ","));
  put_text(settings.name);
  put_field(settings.rate_hz);
  put_field(settings.near_us);
  put_field(settings.far_us);
  put_field(settings.spread_us);
  put_checked(',');
  put_checked(temperature_cc == NO_TEMPERATURE ? '0' : '1');
  end_line();
}

/* ---- Settings and the commands that change them ---- */

static struct settings stored EEMEM;
static uint8_t saved_upto = sizeof(struct settings);

static uint8_t check_of(const struct settings *s)
{
  uint8_t check = 0xA5;
  for (uint8_t i = 0; i < offsetof(struct settings, check); i++)
    check = _crc_ibutton_update(check, ((const uint8_t *)s)[i]);
  return check;
}

static void load_settings(void)
{
  eeprom_read_block(&settings, &stored, sizeof settings);
  if (settings.version == 1 && settings.check == check_of(&settings))
    return;
  memset(&settings, 0, sizeof settings);
  settings.version = 1;
  settings.rate_hz = 100;
  settings.near_us = BLANK_US;
  settings.far_us = FAR_US;
}

/* Write one byte at a time, and only if it differs: a write takes 3.4 ms, and a cell lasts for 100,000 writes. */
static void save_settings(void)
{
  if (saved_upto < sizeof settings && eeprom_is_ready()) {
    eeprom_update_byte((uint8_t *)&stored + saved_upto, ((const uint8_t *)&settings)[saved_upto]);
    saved_upto++;
  }
}

#define COMMAND_BYTES 20

static volatile char command[COMMAND_BYTES];
static volatile uint8_t command_length, command_waits;

ISR(USART_RX_vect)
{
  char c = UDR0;
  if (command_waits)
    return; /* one at a time */
  if (c == '\n' || c == '\r') {
    command[command_length < COMMAND_BYTES ? command_length : 0] = 0; /* a line that was too long is no command */
    command_waits = command_length > 0;
    command_length = 0;
  } else if (command_length < COMMAND_BYTES - 1) {
    command[command_length++] = c;
  } else {
    command_length = COMMAND_BYTES; /* too long: ignored to its end */
  }
}

/* Parse a number up to the end or a comma, and step after it. Return 0 if there is none or it is out of range. */
static uint8_t parse(const char **text, uint16_t least, uint16_t most, uint16_t *value)
{
  uint32_t number = 0;
  uint8_t digits = 0;
  while (**text >= '0' && **text <= '9' && digits < 6) {
    number = number * 10 + (uint8_t)(**text - '0');
    (*text)++;
    digits++;
  }
  if (digits == 0 || number < least || number > most || (**text != 0 && **text != ','))
    return 0;
  if (**text == ',')
    (*text)++;
  *value = (uint16_t)number;
  return 1;
}

static uint8_t is_name(const char *text)
{
  if (strlen(text) > NAME_BYTES)
    return 0;
  for (; *text; text++)
    if (!((*text >= '0' && *text <= '9') || (*text >= 'A' && *text <= 'Z') || (*text >= 'a' && *text <= 'z') ||
          *text == '-' || *text == '_' || *text == '.'))
      return 0;
  return 1;
}

/* Return whether the command was understood. */
static uint8_t obey(const char *text)
{
  const char *rest = text + 1;
  uint16_t first, second;
  switch (*text) {
  case '?':
    return *rest == 0;
  case 'R':
    if (!parse(&rest, RATE_HZ_LEAST, RATE_HZ_MOST, &first) || *rest)
      return 0;
    settings.rate_hz = (uint8_t)first;
    break;
  case 'G':
    if (!parse(&rest, BLANK_US, FAR_US_MOST, &first) || !parse(&rest, first, FAR_US_MOST, &second) || *rest)
      return 0;
    cli();
    settings.near_us = first;
    settings.far_us = second;
    sei();
    break;
  case 'J':
    if (!parse(&rest, 0, SPREAD_US_MOST, &first) || *rest)
      return 0;
    settings.spread_us = first;
    break;
  case 'N':
    if (!is_name(rest))
      return 0;
    memset(settings.name, 0, sizeof settings.name);
    strcpy(settings.name, rest);
    break;
  default:
    return 0;
  }
  settings.check = check_of(&settings);
  saved_upto = 0;
  return 1;
}

static void commands(void)
{
  if (!command_waits || room() < ANSWER_ROOM)
    return;
  char text[COMMAND_BYTES];
  for (uint8_t i = 0; i < COMMAND_BYTES; i++)
    text[i] = command[i];
  command_waits = 0;
  if (obey(text)) {
    identify = 1;
  } else {
    begin_line();
    put_flash(PSTR("X1,command"));
    end_line();
  }
}

/* ---- Arduino's two functions ---- */

void setup(void)
{
  TIMSK0 = 0; /* the core's millisecond clock would be one more interrupt */
  TCCR0B = 0; /* PWM, converter and comparator are not used either */
  TCCR2B = 0;
  ADCSRA = 0;
  ACSR = _BV(ACD);
  load_settings();
  PORTB &= (uint8_t)~(TRIG | ECHO);
  DDRB = (DDRB | TRIG) & (uint8_t)~ECHO;
  PORTD &= (uint8_t)~DQ;
  TCCR1B = 0; /* the core has started a PWM on timer 1 */
  TCCR1A = ON_MATCH_NOTHING;
  TCNT1 = 0;
  TIFR1 = _BV(TOV1) | _BV(ICF1) | _BV(OCF1A);
  TIMSK1 = _BV(TOIE1) | _BV(ICIE1);
  TCCR1B = _BV(ICNC1) | _BV(CS10); /* noise canceller (four equal ticks), no prescaler */
  UCSR0A = _BV(U2X0);
  UBRR0 = 16; /* 117647 baud: 2.1 % fast, within the tolerance of 8N1, and the same as in the Arduino core */
  UCSR0C = _BV(UCSZ01) | _BV(UCSZ00);
  UCSR0B = _BV(RXEN0) | _BV(TXEN0) | _BV(RXCIE0);
  set_sleep_mode(SLEEP_MODE_IDLE);
  sei();
  identify = 1;
  grid_us = now_us() + 20000UL;
  next_sequence = (uint32_t)-1;
}

/* Call with interrupts off. Return whether work is pending that no interrupt will announce. */
static uint8_t has_work(void)
{
  return trigger_state == RESTING || closed_waits || (command_waits && room() >= ANSWER_ROOM) ||
         (identify && room() >= ANSWER_ROOM);
}

void loop(void)
{
  struct ping taken;
  if (trigger_state == RESTING)
    plan_ping();
  if (take_closed(&taken))
    send_reading(&taken);
  commands();
  if (now_us() - identified_us >= IDENTIFY_US)
    identify = 1;
  if (identify && room() >= ANSWER_ROOM)
    send_identity();
  save_settings();
  if (trigger_state == WAITING && (int32_t)(next_us - now_us()) > 1500)
    thermometer();
  /* Idle until an interrupt: the counter's overflow brings one every 4.1 ms. */
  cli();
  if (!has_work()) {
    sleep_enable();
    sei();
    sleep_cpu();
    sleep_disable();
  }
  sei();
}
