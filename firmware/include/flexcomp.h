/* SPDX-License-Identifier: Apache-2.0 */
/* flexcomp for C controllers (C99; C90 with <stdint.h>).
 *
 * The controller's control cycle gives a joint command and gets back the command that brings the real,
 * flexible arm to the pose that the nominal arm would have. Parameter sets come in over CANopen or Modbus,
 * are checked, kept in two slots of non-volatile memory and faded in.
 *
 * Memory. All of it is the caller's: one block per object, of the size that a constant names, aligned to 8
 * bytes (flexcomp_memory and its like are such blocks). Nothing is allocated, nothing is static. A block is in use
 * from the init that was given it for as long as any call names the object; init again gives it a new life, and
 * there is nothing to release.
 *
 * Threads. Two contexts. The CYCLE context (a timer interrupt or a real-time thread) calls flexcomp_step and
 * nothing else; it may interrupt the other one at any point and never waits. The BACKGROUND context (main
 * loop, or one thread) calls everything else; two calls of it must not overlap. Hooks are called in the
 * background, from within the call that needs them; they must not call back into the library. Two arms know
 * nothing of each other: each has a cycle and a background of its own. What is said to be of ANY context touches
 * nothing but its arguments.
 *
 * Time. Every call ends after work that is bounded whatever it is given; no call waits, sleeps or takes a lock. The
 * bound is told with each call, in these measures:
 *   small   a few thousand instructions at most
 *   a step  what flexcomp_step takes: fixed passes over six links and at most FLEXCOMP_TERMS effects
 *   a check of an image of n bytes: its CRC, its terms and tables, and where it would move the tool in 32 poses; of
 *           the order of ten steps, and some ten instructions per byte
 * and besides the time of the hooks that it calls. docs/targets.md has the measured figures of time, stack and flash.
 *
 * Faults. An assertion that fails inside (which no input can bring about) calls the function that FLEXCOMP_FAULT
 * names when the library is built: void flexcomp_fault(void), of the firmware's own, which stops the drives and does
 * not return. Where it is not defined, assert() is used.
 *
 * Units: SI (rad, m, kg, N, s), temperature in deg C. Reals are flexcomp_real, the scalar that the library is
 * built for (FLEXCOMP_SCALAR); the robot's geometry is always double, as its hash is taken of it.
 *
 *     static flexcomp_memory memory;
 *     flexcomp_arm *fc = flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage);
 *     flexcomp_boot(fc);                                            before the cycle starts
 *     status = flexcomp_step(fc, q_command, &context, q_corrected);     CYCLE
 *     flexcomp_poll(fc, now_ms);                                    BACKGROUND
 */
#ifndef FLEXCOMP_H
#define FLEXCOMP_H

#include <stddef.h>
#include <stdint.h>

#include "flexcomp_config.h"

/* NOLINTBEGIN(modernize-use-using): this is C */
#ifdef __cplusplus
extern "C" {
#endif

#define FLEXCOMP_JOINTS 6

typedef FLEXCOMP_SCALAR flexcomp_real;

/* --- memory -------------------------------------------------------------------------------------- */

/* One prepared parameter set; there are two. */
#define FLEXCOMP_SET_BYTES                                                                                  \
  (400 * sizeof(flexcomp_real) + FLEXCOMP_TERMS * (20 + 2 * sizeof(flexcomp_real)) + FLEXCOMP_TABLES * 12 + \
   FLEXCOMP_TABLE_VALUES * sizeof(flexcomp_real))
/* Staging memory, the two sets, and all the rest of one arm. */
#define FLEXCOMP_MEMORY_BYTES (2816 + FLEXCOMP_STAGING_BYTES + 2 * FLEXCOMP_SET_BYTES)
/* One CANopen node; one Modbus serial line; one Modbus TCP connection. */
#define FLEXCOMP_CAN_BYTES 1088
#define FLEXCOMP_RTU_BYTES 768
#define FLEXCOMP_TCP_BYTES 768

/* Blocks of these sizes, aligned. */
typedef union flexcomp_memory {
  double align_double;
  uint64_t align_word;
  unsigned char bytes[FLEXCOMP_MEMORY_BYTES];
} flexcomp_memory;
typedef union flexcomp_can_memory {
  double align_double;
  uint64_t align_word;
  unsigned char bytes[FLEXCOMP_CAN_BYTES];
} flexcomp_can_memory;
typedef union flexcomp_rtu_memory {
  double align_double;
  uint64_t align_word;
  unsigned char bytes[FLEXCOMP_RTU_BYTES];
} flexcomp_rtu_memory;
typedef union flexcomp_tcp_memory {
  double align_double;
  uint64_t align_word;
  unsigned char bytes[FLEXCOMP_TCP_BYTES];
} flexcomp_tcp_memory;

typedef struct flexcomp_arm flexcomp_arm; /* one arm */
typedef struct flexcomp_can flexcomp_can; /* a CANopen node on it */
typedef struct flexcomp_rtu flexcomp_rtu; /* a Modbus serial line on it */
typedef struct flexcomp_tcp flexcomp_tcp; /* a Modbus TCP connection on it */

/* --- the robot ----------------------------------------------------------------------------------- */

/* Rot(z,theta) Trans(z,d) Trans(x,a) Rot(x,alpha) Rot(y,beta); theta is added to the joint reading. */
typedef struct flexcomp_link {
  double theta_rad;
  double d_m;
  double a_m;
  double alpha_rad;
  double beta_rad;
} flexcomp_link;

/* The nominal arm. A set is bound to the name and to the geometry of the links, to the last bit. */
typedef struct flexcomp_robot {
  const char* name; /* UTF-8, zero-terminated; copied */
  flexcomp_link links[FLEXCOMP_JOINTS];
  double min_rad[FLEXCOMP_JOINTS]; /* limits of the joint readings */
  double max_rad[FLEXCOMP_JOINTS];
  double gravity_m_s2[3]; /* in F0, the frame of the robot's base */
  double tool_xyz_m[3];   /* origin of the tool frame in the flange frame F6 */
  double tool_wxyz[4];    /* Hamilton quaternion of norm 1, maps the tool frame to F6 */
  double payload_kg;      /* default load */
  double payload_com_m[3];
  double reference_temperature_c;
} flexcomp_robot;

/* No name, no links, limits of two turns, gravity (0, 0, -9.8), tool at the flange, no payload, 20 deg C. ANY
 * context; small. `flexcomp export` writes a whole robot as a constant of this type. */
void flexcomp_robot_default(flexcomp_robot* robot);

/* --- settings ------------------------------------------------------------------------------------ */

typedef enum flexcomp_on_refusal {
  FLEXCOMP_PASS_THROUGH = 0,        /* the correction fades out to zero */
  FLEXCOMP_HOLD_LAST_CORRECTION = 1 /* the last correction stays on top of the command */
} flexcomp_on_refusal;

typedef struct flexcomp_settings {
  flexcomp_real largest_correction_rad;    /* of any joint */
  flexcomp_real direction_band_rad;        /* motion after which a joint counts as reversed */
  flexcomp_real plausible_position_m;      /* a set that moves the tool farther is refused */
  flexcomp_real plausible_orientation_rad; /* the same for its orientation, below pi / 2 */
  uint32_t fade_cycles;                    /* control cycles over which a set is faded in */
  uint32_t trial_cycles;                   /* control cycles of a trial that names none */
  uint32_t staging_timeout_ms;             /* after which an abandoned transfer is dropped */
  uint32_t cycle_us;                       /* period of the control cycle, told to clients */
  flexcomp_on_refusal on_refusal;          /* what becomes of a command that cannot be corrected */
} flexcomp_settings;

/* 0.1 rad, 1e-4 rad, 0.05 m, 0.1 rad, 1000, 60000, 30000 ms, 1000 us, FLEXCOMP_PASS_THROUGH. ANY context; small. */
void flexcomp_settings_default(flexcomp_settings* settings);

/* --- non-volatile memory ------------------------------------------------------------------------- */

typedef enum flexcomp_storage_result {
  FLEXCOMP_STORAGE_FAILED = -1,
  FLEXCOMP_STORAGE_DONE = 0,
  FLEXCOMP_STORAGE_BUSY = 1 /* erase and write only: under way, the same call comes again at the next poll */
} flexcomp_storage_result;

/* Two slots, 0 and 1, of FLEXCOMP_SLOT_BYTES each. Called in the background; the cycle never waits for them. Any
 * hook may be NULL: then nothing is kept and every commit is refused. Power may fail within any call.
 * read: `size` bytes from `offset`; bytes never written may read as anything. Never busy.
 * erase: makes a whole slot writable. write: `size` bytes (a multiple of 32, at most 256) at `offset` (a
 * multiple of 32) of an erased slot, each byte once between two erases; done means that they survive a power
 * loss. */
typedef struct flexcomp_storage {
  void* user;
  flexcomp_storage_result (*read)(void* user, unsigned slot, uint32_t offset, uint8_t* to, uint32_t size);
  flexcomp_storage_result (*erase)(void* user, unsigned slot);
  flexcomp_storage_result (*write)(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                   uint32_t size);
} flexcomp_storage;

/* --- one arm ------------------------------------------------------------------------------------- */

/* Builds an arm in `memory`. `settings` and `storage` may be NULL: defaults, and no non-volatile memory. All is
 * copied. NULL where the memory is too small or misaligned, or the robot is not sensible: a number that is not
 * finite, crossed limits, a quaternion off norm 1 by more than 1e-3, no name. BACKGROUND, before the cycle starts;
 * the hashes of robot and name, and clearing the memory: a few instructions per byte of it. No hook. */
flexcomp_arm* flexcomp_init(void* memory, size_t size, const flexcomp_robot* robot,
                            const flexcomp_settings* settings, const flexcomp_storage* storage);

/* Loads the set from storage: the highest valid sequence, else the other one, else none. Once, before the cycle
 * starts. Returns the fault bits of flexcomp_state. BACKGROUND; four calls of `read`, and two images' checks. */
unsigned flexcomp_boot(flexcomp_arm* fc);

/* What the joints carry, in one control cycle. */
typedef struct flexcomp_context {
  flexcomp_real payload_kg;
  flexcomp_real payload_com_m[3]; /* centre of mass in F6 */
  flexcomp_real force_n[3];       /* external force at the origin of the tool frame, in F0 */
  flexcomp_real temperature_c;
  flexcomp_real time_s;
  flexcomp_real
      relative_speed[FLEXCOMP_JOINTS]; /* of each joint's last motion to the fastest joint's; 0 if unknown */
} flexcomp_context;

/* The robot's default payload and reference temperature, nothing else. BOTH contexts, also at the same time: what it
 * reads never changes after init. Small. */
void flexcomp_context_default(const flexcomp_arm* fc, flexcomp_context* context);

typedef enum flexcomp_status {
  FLEXCOMP_OK = 0,
  FLEXCOMP_NEAR_SINGULAR = 1, /* corrected; orientation was given up before position */
  FLEXCOMP_LIMITED = 2,       /* the correction was scaled down to the largest allowed one */
  FLEXCOMP_AT_LIMIT = 3,      /* a corrected joint is held at its limit */
  FLEXCOMP_NO_SET = 4,        /* no parameter set: the command is passed through */
  FLEXCOMP_REFUSED = 5        /* not finite or beyond a limit: passed through or held, as configured */
} flexcomp_status;

/* One control cycle: joint command (rad) in, corrected joint command (rad) out; the two may be the same array.
 * `context` may be NULL: the default one. Directions of motion are tracked from the commands. Where a set changes,
 * the command moves by at most 1.5 / fade_cycles of the difference per cycle. CYCLE: from one interrupt or thread,
 * at any time after init; may interrupt every other call of this header. Bounded work on any input, no hook, no waiting: a
 * fixed number of passes of the model; small where there is no set. */
flexcomp_status flexcomp_step(flexcomp_arm* fc, const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                              const flexcomp_context* context,
                              flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS]);

/* Goes on with what is under way (writing a slot, trials, timeouts). Every 10 ms or so; a commit of n bytes takes
 * about n / 256 + 3 polls. now_ms is any clock that wraps at 32 bits. BACKGROUND; small, and at most one `erase`
 * or one `write` of 256 bytes with one `read` of as many. */
void flexcomp_poll(flexcomp_arm* fc, uint32_t now_ms);

/* What the parameter store and the cycle are doing. */
typedef struct flexcomp_state {
  uint32_t active_sequence;   /* 0: none */
  uint32_t previous_sequence; /* what a rollback would return to, 0: none */
  uint32_t active_bytes;      /* of the active image */
  uint32_t trial_cycles_left; /* 0: no trial */
  uint32_t cycles;            /* since the start; wraps */
  uint32_t detail;            /* of the last answer or refusal */
  unsigned store;             /* 0 idle, 1 receiving, 2 verified, 3 working, 4 trial */
  unsigned answer;            /* to the last command; flexcomp_answer_text */
  unsigned refusal;           /* of the last image; flexcomp_refusal_text */
  unsigned faults; /* bits: 1 no valid set, 2 older slot in use, 4 storage failed, 8 trial reverted */
} flexcomp_state;

/* BACKGROUND; small. */
void flexcomp_get_state(const flexcomp_arm* fc, flexcomp_state* state);

/* Commands from local control (an operator panel): numbers as on the wire. Returns the answer; the work is done by the
 * polls that follow. BACKGROUND; small, but for a rollback one `read` of an image and its check. */
#define FLEXCOMP_COMMAND_CONFIRM 5
#define FLEXCOMP_COMMAND_ROLLBACK 6
#define FLEXCOMP_COMMAND_RESTORE_DEFAULTS 8
unsigned flexcomp_command(flexcomp_arm* fc, unsigned command);

/* Texts in English, lower case, without a full stop; any number is answered. ANY context; small. */
const char* flexcomp_status_text(flexcomp_status status);
const char* flexcomp_answer_text(unsigned answer);
const char* flexcomp_refusal_text(unsigned refusal);
const char* flexcomp_version(void);

/* --- CANopen (CiA 301) --------------------------------------------------------------------------- */

/* Sends a data frame with an 11-bit identifier. 0 where there is no room now; it is offered again. Called within
 * flexcomp_can_receive and flexcomp_can_poll; puts the frame into a mailbox or a queue and does not wait for it. */
typedef int (*flexcomp_can_send)(void* user, uint16_t id, const uint8_t* bytes, uint8_t size);

/* A node (1 ... 127) with this heartbeat time (ms, 0: none) in `memory` of FLEXCOMP_CAN_BYTES. NULL where an
 * argument is out of range. At most one node per arm and bus. BACKGROUND, like all that follows; small, no hook. */
flexcomp_can* flexcomp_can_init(void* memory, size_t size, flexcomp_arm* fc, unsigned node,
                                uint16_t heartbeat_ms, flexcomp_can_send send, void* user);
/* A data frame with an 11-bit identifier from the bus; any may be given, and those that are not this node's are passed
 * over. Not from the receive interrupt, if that may hold up the cycle: put frames into a queue there. BACKGROUND;
 * small and one frame sent, but for the frame that
 *   begins an image (clears FLEXCOMP_STAGING_BYTES),   reads one (one `read` of up to 576 bytes),
 *   ends a probe (two steps),   verifies or commits (a check of the image),   rolls back (one `read`, and a check). */
void flexcomp_can_receive(flexcomp_can* can, uint16_t id, const uint8_t* bytes, size_t size);
/* Boot-up, heartbeat, timeouts, and what could not be sent. Every few milliseconds. BACKGROUND; small, at most three
 * frames sent. */
void flexcomp_can_poll(flexcomp_can* can, uint32_t now_ms);

/* --- Modbus -------------------------------------------------------------------------------------- */

/* Sends bytes; called at most once per request, within the call that received it. The bytes are the library's: copy
 * them, or send them before returning. */
typedef void (*flexcomp_send)(void* user, const uint8_t* bytes, size_t size);

/* RTU: unit 1 ... 247. gap_us is the silence after which the line is taken as back in step: 1750 where bytes are
 * seen as they come, more where they come in bursts. The receiver must be off while sending. BACKGROUND; small, no
 * hook. */
flexcomp_rtu* flexcomp_rtu_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit, uint32_t gap_us,
                                flexcomp_send send, void* user);
/* Bytes from the line, received until now_us (any clock that wraps at 32 bits), in any portions; the sooner after the
 * last byte of a request the call comes, the sooner the answer is sent. BACKGROUND; some fifty instructions per byte,
 * and per request what flexcomp_can_receive says. */
void flexcomp_rtu_receive(flexcomp_rtu* rtu, const uint8_t* bytes, size_t size, uint32_t now_us);
/* Ends frames at the gap. Every millisecond or so. BACKGROUND; small, or one request. */
void flexcomp_rtu_poll(flexcomp_rtu* rtu, uint32_t now_us);

/* TCP: one object per connection that may be open at a time; init again (or reset) for the next
 * connection. BACKGROUND; small, no hook. */
flexcomp_tcp* flexcomp_tcp_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit,
                                flexcomp_send send, void* user);
/* Bytes of the stream in any portions. 0 where it is not Modbus: close the connection. BACKGROUND; as for RTU. */
int flexcomp_tcp_receive(flexcomp_tcp* tcp, const uint8_t* bytes, size_t size);
/* The connection has gone: drops what it staged and makes the object ready for the next one. BACKGROUND; small. */
void flexcomp_tcp_reset(flexcomp_tcp* tcp);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(modernize-use-using) */

#endif
