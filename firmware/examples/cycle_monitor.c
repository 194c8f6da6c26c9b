/* SPDX-License-Identifier: Apache-2.0 */
#include "cycle_monitor.h"

/* What a cycle was: without a set, with one, settling after a change to another one, settling after one to none. Kept apart are those
 * that took another set over, which costs them some instructions once, and those beside them of which the outside
 * cannot tell on which side of the change they were. */
enum { NO_SET, ACTIVE, SETTLING, SETTLING_OUT, CHANGING, CLASSES };
static const char* const class_names[CLASSES] = {"no_set", "active", "settling", "settling_out", "changing"};

/* Whether the bus was heard or the parameter store was at work a moment ago. */
enum { IDLE, LOADED, LOADS };
static const char* const load_names[LOADS] = {"idle", "loaded"};
enum { LOAD_LASTS_CYCLES = 20 };

typedef struct step_figures {
  uint32_t cycles;
  uint32_t least_ticks;
  uint32_t most_ticks;
} step_figures;

typedef struct correction_figures {
  flexcomp_real largest_rad[FLEXCOMP_JOINTS];         /* correction */
  flexcomp_real change_moving_rad[FLEXCOMP_JOINTS];   /* of the correction from one cycle to the next */
  flexcomp_real change_standing_rad[FLEXCOMP_JOINTS]; /* the same, while the command stood still */
} correction_figures;

typedef struct figures {
  uint32_t cycles;
  uint32_t late;
  uint32_t least_interval_ticks;
  uint32_t most_interval_ticks;
  uint32_t flags;
  flexcomp_real command_rad[FLEXCOMP_JOINTS];
  flexcomp_real correction_rad[FLEXCOMP_JOINTS];
  step_figures steps[CLASSES][LOADS];
  correction_figures corrections[CLASSES];
} figures;

/* Written by the cycle alone; the background copies it. */
static figures recorded;

/* One step that waits for its class. The background announces a change of set a moment after the cycle has taken
 * it, so steps are filed some cycles later. */
typedef struct sample {
  uint32_t cycle;
  uint32_t ticks;
  uint32_t flags;
  int settling;
  int loaded;
  int standing;
  flexcomp_real correction_rad[FLEXCOMP_JOINTS];
  flexcomp_real change_rad[FLEXCOMP_JOINTS];
} sample;
enum { DELAY = 8 };
static sample waiting[DELAY];

static volatile uint32_t cycle_number;
static volatile uint32_t clear_wanted;
/* Written by the background alone: the cycles between which the last change of set took place, and until when the
 * bus counts as loaded. */
static volatile uint32_t change_after = 0xC0000000U;
static volatile uint32_t change_until = 0xC0000000U;
static volatile uint32_t loaded_until = 0;

/* --- cycle --------------------------------------------------------------------------------------- */

static int class_of(const sample* s) {
  /* The set was taken in one of the cycles change_after + 1 … change_until + 1. */
  const int32_t since_first = (int32_t)(s->cycle - change_after) - 1;
  const int32_t since_last = (int32_t)(s->cycle - change_until) - 1;
  const int none = (s->flags & FLEXCOMP_FLAG_NO_SET) != 0;
  if (since_first >= 0 && since_last <= 0) return CHANGING;
  if (s->settling) return none ? SETTLING_OUT : SETTLING;
  return none ? NO_SET : ACTIVE;
}

static void raise_to(flexcomp_real* largest, flexcomp_real v) {
  if (v < 0) v = -v;
  if (v > *largest) *largest = v;
}

static void file(const sample* s) {
  const int c = class_of(s);
  step_figures* steps = &recorded.steps[c][s->loaded ? LOADED : IDLE];
  correction_figures* corrections = &recorded.corrections[c];
  if (steps->cycles == 0 || s->ticks < steps->least_ticks) steps->least_ticks = s->ticks;
  if (s->ticks > steps->most_ticks) steps->most_ticks = s->ticks;
  ++steps->cycles;
  for (unsigned j = 0; j < FLEXCOMP_JOINTS; ++j) {
    raise_to(&corrections->largest_rad[j], s->correction_rad[j]);
    raise_to(s->standing ? &corrections->change_standing_rad[j] : &corrections->change_moving_rad[j],
             s->change_rad[j]);
  }
}

void monitor_cycle(uint32_t start_ticks, uint32_t end_ticks, uint32_t flags,
                   const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                   const flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS], int late) {
  static flexcomp_real last_command_rad[FLEXCOMP_JOINTS];
  static uint32_t last_start_ticks;
  static uint32_t settling_cycles;
  static const figures nothing;
  const uint32_t number = cycle_number + 1;
  sample* s = &waiting[number % DELAY];
  if (number > DELAY && s->cycle != 0) file(s);
  if (clear_wanted != 0) {
    recorded = nothing;
    for (unsigned k = 0; k < DELAY; ++k) waiting[k].cycle = 0;
    clear_wanted = 0;
  }

  s->cycle = number;
  s->ticks = end_ticks - start_ticks;
  s->flags = flags;
  /* In the cycle in which the offset becomes 0 the flag is not set any more, and one later its motion has ended. */
  if ((flags & FLEXCOMP_FLAG_SETTLING) != 0) settling_cycles = 3;
  s->settling = settling_cycles != 0;
  if (settling_cycles != 0) --settling_cycles;
  recorded.flags = flags;
  s->loaded = (int32_t)(loaded_until - number) > 0;
  s->standing = 1;
  for (unsigned j = 0; j < FLEXCOMP_JOINTS; ++j) {
    const flexcomp_real correction = q_corrected_rad[j] - q_command_rad[j];
    if (q_command_rad[j] < last_command_rad[j] || q_command_rad[j] > last_command_rad[j]) s->standing = 0;
    s->change_rad[j] = correction - recorded.correction_rad[j];
    s->correction_rad[j] = correction;
    recorded.command_rad[j] = q_command_rad[j];
    recorded.correction_rad[j] = correction;
    last_command_rad[j] = q_command_rad[j];
  }
  /* The first cycle has none before it. */
  if (recorded.cycles != 0) {
    const uint32_t interval = start_ticks - last_start_ticks;
    if (recorded.cycles == 1 || interval < recorded.least_interval_ticks)
      recorded.least_interval_ticks = interval;
    if (interval > recorded.most_interval_ticks) recorded.most_interval_ticks = interval;
  } else {
    s->cycle = 0;
  }
  last_start_ticks = start_ticks;
  ++recorded.cycles;
  if (late) ++recorded.late;
  cycle_number = number;
}

/* --- background ---------------------------------------------------------------------------------- */

static uint32_t number_before_poll;

void monitor_bus_heard(void) { loaded_until = cycle_number + LOAD_LASTS_CYCLES; }

void monitor_before_poll(void) { number_before_poll = cycle_number; }

void monitor_after_poll(const flexcomp_state* state) {
  static uint32_t last_sequence;
  if (state->store != 0) monitor_bus_heard();
  if (state->active_sequence == last_sequence) return;
  last_sequence = state->active_sequence;
  /* In this order: a cycle that comes in between takes the whole change as not yet over. */
  change_until = cycle_number;
  change_after = number_before_poll;
}

void monitor_clear(void) { clear_wanted = 1; }

typedef struct text {
  char* to;
  size_t size;
  size_t length;
} text;

static void put(text* t, const char* s) {
  for (; *s != 0; ++s) {
    if (t->length + 1 < t->size) t->to[t->length] = *s;
    ++t->length;
  }
}

static void put_number(text* t, const char* before, int32_t v) {
  char digits[12];
  size_t at = sizeof digits - 1;
  uint32_t rest = v < 0 ? 0U - (uint32_t)v : (uint32_t)v;
  digits[at] = 0;
  do digits[--at] = (char)('0' + rest % 10U);
  while ((rest /= 10U) != 0);
  if (v < 0) digits[--at] = '-';
  put(t, before);
  put(t, digits + at);
}

static void put_angles(text* t, const char* before, const flexcomp_real rad[FLEXCOMP_JOINTS]) {
  put(t, before);
  for (unsigned j = 0; j < FLEXCOMP_JOINTS; ++j) {
    put_number(t, j == 0 ? "[" : ", ", (int32_t)(rad[j] * (flexcomp_real)1e9F));
  }
  put(t, "]");
}

size_t monitor_report(char* to, size_t size) {
  static figures f;
  text t = {to, size, 0};
  if (size == 0) return 0;
  /* The cycle goes on meanwhile: a copy that it interrupted is made again. */
  uint32_t number;
  do {
    number = cycle_number;
    __asm volatile("" ::: "memory");
    f = recorded;
    __asm volatile("" ::: "memory");
  } while (number != cycle_number || clear_wanted != 0);

  put_number(&t, "{\"cycles\": ", (int32_t)f.cycles);
  put_number(&t, ", \"late\": ", (int32_t)f.late);
  put_number(&t, ", \"interval_ticks\": [", (int32_t)f.least_interval_ticks);
  put_number(&t, ", ", (int32_t)f.most_interval_ticks);
  put_number(&t, "], \"flags\": ", (int32_t)f.flags);
  put_angles(&t, ", \"command_nrad\": ", f.command_rad);
  put_angles(&t, ", \"correction_nrad\": ", f.correction_rad);
  for (int c = 0; c < CLASSES; ++c) {
    put(&t, ", \"");
    put(&t, class_names[c]);
    for (int l = 0; l < LOADS; ++l) {
      const step_figures* s = &f.steps[c][l];
      put(&t, l == 0 ? "\": {\"" : ", \"");
      put(&t, load_names[l]);
      put_number(&t, "\": {\"cycles\": ", (int32_t)s->cycles);
      put_number(&t, ", \"step_ticks\": [", (int32_t)s->least_ticks);
      put_number(&t, ", ", (int32_t)s->most_ticks);
      put(&t, "]}");
    }
    put_angles(&t, ", \"largest_nrad\": ", f.corrections[c].largest_rad);
    put_angles(&t, ", \"change_moving_nrad\": ", f.corrections[c].change_moving_rad);
    put_angles(&t, ", \"change_standing_nrad\": ", f.corrections[c].change_standing_rad);
    put(&t, "}");
  }
  put(&t, "}\n");
  if (t.length + 1 > size) t.length = 0;
  to[t.length] = 0;
  return t.length;
}
