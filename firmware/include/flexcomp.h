/* SPDX-License-Identifier: Apache-2.0 */
/** \file
 * C interface of the flexcomp firmware library (C99; C90 with <stdint.h>).
 *
 * How to integrate. Compile firmware/src and link it, or use the CMake target flexcomp::firmware; then
 *
 *     static flexcomp_memory memory;                                 1. memory for one arm
 *     flexcomp_arm *fc = flexcomp_init(&memory, sizeof memory, &robot, NULL, &storage);
 *     flexcomp_boot(fc);                                             2. load the stored set, before the cycle
 *     flexcomp_start(fc, q_standing);                                3. where the arm stands: nothing moves
 *     status = flexcomp_step(fc, q_command, &context, q_corrected);  4. CYCLE: correct every joint command
 *     flexcomp_poll(fc, now_ms);                                     5. BACKGROUND: every 10 ms or so
 *     flexcomp_can_receive(can, id, bytes, size);                    6. BACKGROUND: frames of a bus
 *
 * In place of 4, where the drives take feed-forward: flexcomp_step_rate, with the corrected velocity. In place of
 * 6, where a fieldbus of yours or a file brings the sets: flexcomp_stage_begin, _write, _verify, _commit. Beside
 * them: flexcomp_uncorrect (encoders to command, for start, jogging, display), flexcomp_tool_pose and
 * flexcomp_joint_loads; flexcomp_get_diagnostics after a step; flexcomp_set_hooks, by which the program permits
 * or refuses commands of the buses and writes a log.
 *
 * `robot` is a constant that `flexcomp export` writes, `storage` three functions for two slots of flash.
 * firmware/examples has whole controllers (minimal_controller.c; two_arms.c with two arms; servo_loop.c with
 * feed-forward), docs/firmware.md the steps one by one.
 *
 * How it works. The control cycle gives a joint command and gets back the command at which the flexible arm
 * has the pose that the nominal arm would have (docs/compensation.md). Parameter sets arrive over CANopen or
 * Modbus, are verified, stored in two slots of non-volatile memory and taken over by a bounded motion.
 *
 * Memory. All of it is the caller's: one block per object, of the size that a constant names, aligned to 8
 * bytes (flexcomp_memory and its like are such blocks). Nothing is allocated, nothing is static. A block is
 * in use from the init that was given it for as long as any call names the object; another init reuses it,
 * and there is nothing to release.
 *
 * Threads. Two contexts. The CYCLE context (a timer interrupt or a real-time thread) calls flexcomp_step or
 * flexcomp_step_rate, with flexcomp_step_flags and flexcomp_get_diagnostics, and flexcomp_start where it begins
 * anew; it may interrupt the other one at any point and never waits. The BACKGROUND context (main loop, or one
 * thread) calls everything else; two calls of it must not overlap. A call for BOTH contexts may run in both at
 * the same time. Hooks are called in the background, from within the call that needs
 * them; they must not call back into the library. Two arms share nothing: each has a cycle and a background
 * of its own. A call for ANY context touches nothing but its arguments.
 *
 * Time. Every call ends after work that is bounded on any input; no call waits, sleeps or takes a lock. The
 * bound stands with each call, in these measures:
 *   small   a few thousand instructions at most
 *   a step  as flexcomp_step: a fixed number of passes over six links and at most FLEXCOMP_TERMS effects
 *   a pass  the forward model once: less than a step
 *   a check of an image of n bytes: its CRC, its terms and tables, and the motion of the tool in 32 poses; of
 *           the order of ten steps, and some ten instructions per byte
 * and in addition the time of the hooks that it calls. docs/targets.md has the measured figures of time,
 * stack and flash.
 *
 * Faults. An assertion that fails inside (which no input can cause) calls the function that FLEXCOMP_FAULT
 * names when the library is built: void flexcomp_fault(void), of the firmware's own, which stops the drives
 * and does not return. Where it is not defined, assert() is used.
 *
 * Units: SI (rad, m, kg, N, s), temperature in deg C. Reals are flexcomp_real, the scalar that the library is
 * built for (FLEXCOMP_SCALAR); the robot's geometry is always double, as it is hashed.
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

/** Joints of an arm. */
#define FLEXCOMP_JOINTS 6

/** Scalar of all reals but the robot's geometry. */
typedef FLEXCOMP_SCALAR flexcomp_real;

/* --- memory -------------------------------------------------------------------------------------- */

/** Memory of one prepared parameter set; there are two. */
#define FLEXCOMP_SET_BYTES                                                                                  \
  (400 * sizeof(flexcomp_real) + FLEXCOMP_TERMS * (20 + 2 * sizeof(flexcomp_real)) + FLEXCOMP_TABLES * 12 + \
   FLEXCOMP_TABLE_VALUES * sizeof(flexcomp_real))
/** Memory of one arm: staging, two sets, and the rest. */
#define FLEXCOMP_MEMORY_BYTES (4096 + FLEXCOMP_STAGING_BYTES + 2 * FLEXCOMP_SET_BYTES)
/** Memory of one CANopen node. */
#define FLEXCOMP_CAN_BYTES 1248
/** Memory of one Modbus serial line. */
#define FLEXCOMP_RTU_BYTES 768
/** Memory of one Modbus TCP connection. */
#define FLEXCOMP_TCP_BYTES 768

/** Aligned block of memory for an arm. */
typedef union flexcomp_memory {
  double align_double;                        /**< for the alignment only */
  uint64_t align_word;                        /**< for the alignment only */
  unsigned char bytes[FLEXCOMP_MEMORY_BYTES]; /**< the memory */
} flexcomp_memory;
/** Aligned block of memory for a CANopen node. */
typedef union flexcomp_can_memory {
  double align_double;                     /**< for the alignment only */
  uint64_t align_word;                     /**< for the alignment only */
  unsigned char bytes[FLEXCOMP_CAN_BYTES]; /**< the memory */
} flexcomp_can_memory;
/** Aligned block of memory for a Modbus serial line. */
typedef union flexcomp_rtu_memory {
  double align_double;                     /**< for the alignment only */
  uint64_t align_word;                     /**< for the alignment only */
  unsigned char bytes[FLEXCOMP_RTU_BYTES]; /**< the memory */
} flexcomp_rtu_memory;
/** Aligned block of memory for a Modbus TCP connection. */
typedef union flexcomp_tcp_memory {
  double align_double;                     /**< for the alignment only */
  uint64_t align_word;                     /**< for the alignment only */
  unsigned char bytes[FLEXCOMP_TCP_BYTES]; /**< the memory */
} flexcomp_tcp_memory;

typedef struct flexcomp_arm flexcomp_arm; /**< one arm */
typedef struct flexcomp_can flexcomp_can; /**< a CANopen node on it */
typedef struct flexcomp_rtu flexcomp_rtu; /**< a Modbus serial line on it */
typedef struct flexcomp_tcp flexcomp_tcp; /**< a Modbus TCP connection on it */

/* --- the robot ----------------------------------------------------------------------------------- */

/** One nominal link (docs/model.md, M2): Rot(z,theta) Trans(z,d) Trans(x,a) Rot(x,alpha) Rot(y,beta). */
typedef struct flexcomp_link {
  double theta_rad; /**< added to the joint reading */
  double d_m;       /**< along z */
  double a_m;       /**< along x */
  double alpha_rad; /**< about x */
  double beta_rad;  /**< about y */
} flexcomp_link;

/** The nominal arm. A set is bound to the name and to the geometry of the links, to the last bit. */
typedef struct flexcomp_robot {
  const char* name;                     /**< UTF-8, zero-terminated; copied */
  flexcomp_link links[FLEXCOMP_JOINTS]; /**< from the base outward */
  double min_rad[FLEXCOMP_JOINTS];      /**< least joint readings */
  double max_rad[FLEXCOMP_JOINTS];      /**< greatest joint readings */
  double gravity_m_s2[3];               /**< in F0, the frame of the robot's base */
  double tool_xyz_m[3];                 /**< origin of the tool frame in the flange frame F6 */
  double tool_wxyz[4];                  /**< Hamilton quaternion of norm 1, maps the tool frame to F6 */
  double payload_kg;                    /**< default load */
  double payload_com_m[3];              /**< its centre of mass in F6 */
  double reference_temperature_c;       /**< of the nominal lengths */
  const char* serial; /**< number of this unit, UTF-8, zero-terminated; copied; NULL: none */
} flexcomp_robot;

/** Sets a robot without name and links: limits of two turns, gravity (0, 0, -9.8), tool at the flange, no
 * payload, 20 deg C. ANY context; small. `flexcomp export` writes a whole robot as a constant of this type.
 * */
void flexcomp_robot_default(flexcomp_robot* robot);

/* --- settings ------------------------------------------------------------------------------------ */

/** Output for a command that cannot be corrected (docs/compensation.md, section 8). */
typedef enum flexcomp_on_refusal {
  /** A command within the joint limits, whose context is not finite, while the correction returns to 0; any
   * other is held as by the next one. */
  FLEXCOMP_PASS_THROUGH = 0,
  FLEXCOMP_HOLD_LAST_OUTPUT = 1 /**< the last output stands */
} flexcomp_on_refusal;

/** Greatest bounds of a set (docs/compensation.md, section "Admission"); a set beyond them is refused. For each joint, and
 * for links, base and tool together with lengths divided by the arm's reach. */
typedef struct flexcomp_admission {
  flexcomp_real value_rad;             /**< of functions of readings: sum of their greatest values */
  flexcomp_real slope;                 /**< of these, rad per rad */
  flexcomp_real scale;                 /**< of terms proportional to a reading */
  flexcomp_real direction_rad;         /**< half the jump at a reversal */
  flexcomp_real compliance_rad_per_nm; /**< by any torque or moment */
  flexcomp_real rad_per_kg;            /**< by the payload's mass */
  flexcomp_real rad_per_n;             /**< by the external force */
  flexcomp_real load_rad;              /**< by all loads at the ranges below */
  flexcomp_real rad_per_k;             /**< by temperature */
  flexcomp_real total_slope;           /**< slope, with that of the loads */
  uint32_t instructions;               /**< of one step, on a Cortex-M7 */
  flexcomp_real payload_kg;            /**< greatest payload; negative: twice the robot's own, or 5 kg */
  flexcomp_real com_m;   /**< its greatest distance from the flange; negative: twice the robot's, or 0.2 m */
  flexcomp_real force_n; /**< greatest external force; negative: none */
  flexcomp_real temperature_k; /**< greatest distance from the reference; negative: 30 K */
  flexcomp_real link_slope;    /**< slope, of links, base and tool */
} flexcomp_admission;

/** Settings of an arm. flexcomp_settings_default() first, then what is to be different: flexcomp_init refuses
 * settings that do not begin with the size that it sets. */
typedef struct flexcomp_settings {
  uint32_t struct_size;                 /**< sizeof(flexcomp_settings); set by flexcomp_settings_default */
  flexcomp_real largest_correction_rad; /**< of any joint */
  /** Greatest slope of the correction over the command near singularities (docs/compensation.md, C9), above 0 and
   * at most 200: a larger one leaves less error there and moves the joints faster. */
  flexcomp_real steepest;
  flexcomp_real direction_band_rad;        /**< motion after which a joint counts as reversed */
  flexcomp_real plausible_position_m;      /**< a set that moves the tool farther is refused */
  flexcomp_real plausible_orientation_rad; /**< the same for its orientation, below pi / 2 */
  /** Greatest rate of each joint's correction. */
  flexcomp_real correction_rate_rad_s[FLEXCOMP_JOINTS];
  /** Greatest rate at which the offset that an event leaves (another set, a jump of the load) returns to
   * 0. */
  flexcomp_real offset_rate_rad_s;
  flexcomp_real offset_acceleration_rad_s2; /**< greatest acceleration of the same */
  uint32_t trial_cycles;                    /**< control cycles of a trial that names none */
  uint32_t staging_timeout_ms;              /**< after which an abandoned transfer is dropped */
  uint32_t cycle_us;                        /**< period of the control cycle: rates are bounded by it */
  flexcomp_on_refusal on_refusal;           /**< output for a command that cannot be corrected */
  flexcomp_admission admission;             /**< bounds beyond which a set is refused */
} flexcomp_settings;

/** Sets the size and the defaults: 0.1 rad, slope 100, 1e-4 rad, 0.05 m, 0.1 rad, 2 rad/s, 0.5 rad/s, 20 rad/s^2,
 * 60000, 30000 ms, 1000 us, FLEXCOMP_HOLD_LAST_OUTPUT; admission as in docs/compensation.md. ANY context; small. */
void flexcomp_settings_default(flexcomp_settings* settings);

/* --- non-volatile memory ------------------------------------------------------------------------- */

/** Result of a storage hook. */
typedef enum flexcomp_storage_result {
  FLEXCOMP_STORAGE_FAILED = -1, /**< reported as a storage fault */
  FLEXCOMP_STORAGE_DONE = 0,    /**< complete */
  FLEXCOMP_STORAGE_BUSY = 1     /**< erase and write only: not complete, the next poll repeats the call */
} flexcomp_storage_result;

/** Non-volatile memory: two slots, 0 and 1, of FLEXCOMP_SLOT_BYTES each. Called in the background; the cycle
 * never waits for them. Any hook may be NULL: then nothing is stored and every commit is refused. Power may
 * fail within any call. */
typedef struct flexcomp_storage {
  void* user; /**< given to every hook */
  /** Reads `size` bytes from `offset` of a slot; bytes never written may read as anything. Never busy. */
  flexcomp_storage_result (*read)(void* user, unsigned slot, uint32_t offset, uint8_t* to, uint32_t size);
  /** Makes a whole slot writable. */
  flexcomp_storage_result (*erase)(void* user, unsigned slot);
  /** Writes `size` bytes (a multiple of 32, at most 256) at `offset` (a multiple of 32) of an erased slot,
   * each byte once between two erases, save one whose writing the power has cut and that reads as erased; done means
   * that they survive a power loss. */
  flexcomp_storage_result (*write)(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                   uint32_t size);
} flexcomp_storage;

/* --- one arm ------------------------------------------------------------------------------------- */

/** Why an init gave NULL. Numbers are added to, never changed. */
typedef enum flexcomp_init_error {
  FLEXCOMP_INIT_DONE = 0,   /**< it did not */
  FLEXCOMP_INIT_MEMORY = 1, /**< missing, too small or misaligned */
  /** A number that is not finite, crossed limits or limits beyond 1e5 rad (float: 1e4), a negative payload, a quaternion off norm 1 by more
   * than 1e-3, or no name. */
  FLEXCOMP_INIT_ROBOT = 2,
  /** A number that is not finite (ranges excepted, which admission judges), a period, rate, acceleration, slope or plausible
   * change that is not above 0, a slope above 200, a plausible turn above pi / 2, a largest correction or band below 0, another
   * answer to a refusal, or another struct_size. */
  FLEXCOMP_INIT_SETTINGS = 3,
  FLEXCOMP_INIT_OTHER_SCALAR = 4,   /**< FLEXCOMP_SCALAR of program and library differ */
  FLEXCOMP_INIT_OTHER_CAPACITY = 5, /**< another value of flexcomp_config.h differs */
  FLEXCOMP_INIT_OTHER_STRUCTS = 6   /**< versions of flexcomp.h, or their layouts, differ */
} flexcomp_init_error;

/** flexcomp_arm* flexcomp_init(void* memory, size_t size, const flexcomp_robot* robot,
 *     const flexcomp_settings* settings, const flexcomp_storage* storage)
 *
 * Builds an arm in `memory`. `settings` and `storage` may be NULL: defaults, and no non-volatile memory. All
 * is copied. NULL for any reason of flexcomp_init_error, which flexcomp_init_explained tells. A macro, because
 * what the program was compiled with has to be that of the library: a program with another scalar, other
 * capacities or another version of this header gets NULL. BACKGROUND, before the cycle starts; the hashes of
 * robot and name, and clearing the memory: a few instructions per byte of it. No hook. */
#define flexcomp_init(memory, size, robot, settings, storage) \
  flexcomp_init_checked(memory, size, robot, settings, storage, NULL, FLEXCOMP_BUILD_)

/** flexcomp_init() that sets *error (unsigned) to a number of flexcomp_init_error. */
#define flexcomp_init_explained(memory, size, robot, settings, storage, error) \
  flexcomp_init_checked(memory, size, robot, settings, storage, error, FLEXCOMP_BUILD_)

/** What program and library have to agree on; for flexcomp_init. */
#define FLEXCOMP_BUILD_                                                                               \
  sizeof(flexcomp_real), FLEXCOMP_JOINTS, FLEXCOMP_TERMS, FLEXCOMP_TABLES, FLEXCOMP_TABLE_VALUES,     \
      FLEXCOMP_STAGING_BYTES,                                                                         \
      sizeof(flexcomp_robot) + 19 * sizeof(flexcomp_trust) + 3 * sizeof(flexcomp_settings) +          \
          5 * sizeof(flexcomp_context) + 7 * sizeof(flexcomp_storage) + 11 * sizeof(flexcomp_state) + \
          13 * sizeof(flexcomp_hooks) + 17 * sizeof(flexcomp_diagnostics)

/** What flexcomp_init calls, with the sizes of the caller's compile. `error` may be NULL. Not for calls by hand. */
flexcomp_arm* flexcomp_init_checked(void* memory, size_t size, const flexcomp_robot* robot,
                                    const flexcomp_settings* settings, const flexcomp_storage* storage,
                                    unsigned* error, size_t real_bytes, size_t joints, size_t terms,
                                    size_t tables, size_t table_values, size_t staging_bytes,
                                    size_t struct_bytes);

/** Text of a flexcomp_init_error in English, lower case, without a full stop; any number is answered. ANY
 * context; small. */
const char* flexcomp_init_error_text(unsigned error);

/** What the hook `log` is told. Numbers are added to, never changed. */
typedef enum flexcomp_event {
  FLEXCOMP_EVENT_BOOTED = 1, /**< the start has loaded what there is; detail: fault bits of flexcomp_state */
  FLEXCOMP_EVENT_IMAGE_REFUSED = 2,   /**< by verification or at the start; detail: flexcomp_refusal_text */
  FLEXCOMP_EVENT_ACTIVATED = 3,       /**< a committed set; detail: its sequence */
  FLEXCOMP_EVENT_TRIAL_BEGUN = 4,     /**< detail: sequence of the set on trial */
  FLEXCOMP_EVENT_TRIAL_CONFIRMED = 5, /**< it is permanent now; detail: its sequence */
  /** It ran out, or could not be made permanent; detail: sequence of the set that is active again, 0: none. */
  FLEXCOMP_EVENT_TRIAL_REVERTED = 6,
  FLEXCOMP_EVENT_ROLLED_BACK = 7, /**< by command; detail: sequence of the set that is active then, 0: none */
  FLEXCOMP_EVENT_RESTORED = 8,    /**< both slots are erased; detail: 0 */
  FLEXCOMP_EVENT_STORAGE_FAILED = 9, /**< detail: the last accepted command, 0 at the start */
  /** `permit` refused, or an unlock or a signature was missing; detail: the command. */
  FLEXCOMP_EVENT_NOT_AUTHORISED = 10,
  FLEXCOMP_EVENT_UNLOCKED =
      11 /**< a client of a bus may roll back or restore now; detail: FLEXCOMP_COMMAND_UNLOCK */
} flexcomp_event;

/** Answer of the hook `permit`; any other number allows. */
typedef enum flexcomp_permit {
  FLEXCOMP_REFUSE = 0, /**< the command is answered `not_authorised` (4) and nothing happens */
  FLEXCOMP_ALLOW = 1,  /**< nothing speaks against it */
  /** The same; and where rollback or restore would need an unlock or a signed command, this takes their place: for a
   * key switch, or a panel. A set needs its signature all the same. */
  FLEXCOMP_AUTHORISE = 2
} flexcomp_permit;

/** What the program decides and is told of. Either hook may be NULL. Called in the background, from within the
 * call in which it happens; they must not call back into the library. */
typedef struct flexcomp_hooks {
  void* user; /**< given to both */
  /** Whether this command of the parameter store is allowed now: a flexcomp_permit. `command` is a FLEXCOMP_COMMAND_ number. `is_local`: not from a bus,
   * but by flexcomp_command or a flexcomp_stage_ call. Asked for every command of every bus; a program may, for
   * example, refuse commit, rollback and restore while the drives move. NULL: all are allowed. */
  unsigned (*permit)(void* user, unsigned command, unsigned is_local);
  /** Told of a flexcomp_event with its detail. */
  void (*log)(void* user, unsigned event, uint32_t detail);
} flexcomp_hooks;

/** Who is asked and told from now on; copied. NULL: nobody. Before flexcomp_boot to hear of the start.
 * BACKGROUND; small. */
void flexcomp_set_hooks(flexcomp_arm* fc, const flexcomp_hooks* hooks);

/** Whose sets are used: those that are signed (Ed25519, RFC 8032) with one of the keys, bound to this unit, and not
 * sent before (docs/security.md). */
typedef struct flexcomp_trust {
  void* user; /**< given to `check` */
  /** Public keys, `flexcomp trust` writes them; not copied: they must outlive the arm. */
  const uint8_t (*keys)[32];
  unsigned count; /**< of the keys, 0 ... 65535; of more than one each counts */
  /** A library's or the platform's Ed25519: 1 where the signature (64 bytes) of the message (48 bytes) belongs to the key, 2
   * where it needs more time (the same call then comes again with the next poll, for staging_timeout_ms; at the start at
   * once, at most 100,000 times for each reading of a slot), any other number where it does not. */
  int (*check)(void* user, const uint8_t* public_key, const uint8_t* signature, const uint8_t* message,
               size_t size);
} flexcomp_trust;

/** From now on only signed sets are used, from the buses, by flexcomp_stage_commit, and of what is stored; rollback and
 * FLEXCOMP_COMMAND_RESTORE_DEFAULTS over a bus need a signed command, or `permit` that authorises. 0, and nothing is
 * changed, after flexcomp_boot, and where `check` or the keys are missing or the robot has no serial number.
 * BACKGROUND; small, no hook. */
int flexcomp_set_trust(flexcomp_arm* fc, const flexcomp_trust* trust);

/** Loads the set from storage: the highest valid sequence, else the other one, else none. Once, before the
 * cycle starts. Returns the fault bits of flexcomp_state. BACKGROUND; four calls of `read`, and two images'
 * checks. */
unsigned flexcomp_boot(flexcomp_arm* fc);

/** Context of one control cycle: load, temperature, time (docs/model.md, section 2). */
typedef struct flexcomp_context {
  flexcomp_real payload_kg;       /**< mass of the payload */
  flexcomp_real payload_com_m[3]; /**< its centre of mass in F6 */
  flexcomp_real force_n[3];       /**< external force at the origin of the tool frame, in F0 */
  flexcomp_real temperature_c;    /**< of the arm */
  flexcomp_real time_s;           /**< of a grid over time */
  /** Speed of each joint's last motion relative to the fastest joint's; 0 if unknown. */
  flexcomp_real relative_speed[FLEXCOMP_JOINTS];
} flexcomp_context;

/** Sets the robot's default payload and reference temperature, all else 0. BOTH contexts, also at the same
 * time: what it reads never changes after init. Small. */
void flexcomp_context_default(const flexcomp_arm* fc, flexcomp_context* context);

/** Where the arm stands, rad: the output of every step until a command lies within the largest correction of
 * it (before that, steps are refused). That command is taken up without any motion, and the correction goes
 * from there to the set's as after any event. Without this call it starts at 0: the first output is the first
 * command, and the arm then moves by the correction. 0 where a number is not finite or beyond a joint limit:
 * nothing is changed. Before the first step, or in the CYCLE context to begin anew; small. */
int flexcomp_start(flexcomp_arm* fc, const flexcomp_real q_standing_rad[FLEXCOMP_JOINTS]);

/** Result of a step: the first that holds of refused, no_set, at_limit, limited, near_singular, ok
 * (docs/compensation.md, section 8). All of them are in flexcomp_step_flags(). */
typedef enum flexcomp_status {
  FLEXCOMP_OK = 0,            /**< corrected */
  FLEXCOMP_NEAR_SINGULAR = 1, /**< corrected, damped: what remains is orientation before position */
  FLEXCOMP_LIMITED = 2,       /**< the correction is scaled, follows at its greatest rate, or settles */
  FLEXCOMP_AT_LIMIT = 3,      /**< a corrected joint is at its limit */
  FLEXCOMP_NO_SET = 4,        /**< no parameter set: the command as it is, once a former set's has settled */
  FLEXCOMP_REFUSED = 5        /**< not finite or beyond a limit; see flexcomp_on_refusal */
} flexcomp_status;

/** One control cycle (C1, C18 to C20): joint command (rad) in, corrected joint command (rad) out; they may be
 * one array. `context` may be NULL: the default one. Directions of motion are tracked from the commands.
 *
 * The output is finite and within the joint limits, whatever comes in. The correction changes by no more per
 * cycle than correction_rate_rad_s allows, and does not jump at an event: a new set, a jump of payload,
 * centre of mass, force or temperature, a limit, a refusal; there the difference returns to 0 at the offset's
 * rate and acceleration. A refused command (not finite, beyond a joint limit, with a context that is not
 * finite) gives the last output again, or what flexcomp_on_refusal says. The next command that is used is
 * reached from there as after any event: a controller that sees FLEXCOMP_REFUSED stops the program, or the
 * arm catches up with it on a path of its own. Until the first command that is used (and without
 * flexcomp_start) a refused command goes out joint by joint as far as it is finite, a joint that never was as
 * 0 or its nearest limit: do not enable the drives before that.
 *
 * CYCLE: from one interrupt or thread, at any time after init; may interrupt every other call of this header.
 * Bounded work on any input, no hook, no waiting: a fixed number of passes of the model; small where there is
 * no set. */
flexcomp_status flexcomp_step(flexcomp_arm* fc, const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                              const flexcomp_context* context,
                              flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS]);

/** Bits of flexcomp_step_flags(). Numbers are on the wire: they are added to, never changed. */
typedef enum flexcomp_step_flag {
  FLEXCOMP_FLAG_REFUSED = 1,        /**< the command or its context was not used */
  FLEXCOMP_FLAG_NO_SET = 2,         /**< no valid parameter set */
  FLEXCOMP_FLAG_AT_LIMIT = 4,       /**< a corrected joint is at its limit */
  FLEXCOMP_FLAG_LIMITED = 8,        /**< the correction was scaled to the largest one allowed */
  FLEXCOMP_FLAG_RATE_LIMITED = 16,  /**< the correction follows at its greatest rate */
  FLEXCOMP_FLAG_SETTLING = 32,      /**< the difference that an event left has not returned to 0 yet */
  FLEXCOMP_FLAG_NOT_CONVERGED = 64, /**< the last iterate was still above its tolerance */
  FLEXCOMP_FLAG_NEAR_SINGULAR = 128 /**< damped or scaled near a singularity */
} flexcomp_step_flag;

/** All that held the last step back, bits of flexcomp_step_flag; 0 where the output is the corrected command
 * and the status FLEXCOMP_OK. BOTH contexts; small. */
uint32_t flexcomp_step_flags(const flexcomp_arm* fc);

/** flexcomp_step() with velocities (rad/s) for the feed-forward of the drives (docs/compensation.md, C22): the rate
 * of the command in, the rate of the corrected command out; arrays may be shared.
 *
 * Where nothing holds back it is the analytic derivative, context and set standing still, and while an event
 * settles that and the motion of its offset. In every cycle in which anything else holds back (rate_limited,
 * at_limit, limited, near_singular, not_converged, no_set), in which an event begins or a tracked direction turns,
 * it is what was really put out: the command's rate and the change of the correction since the last cycle over
 * cycle_us. 0 where the output stands. Always finite; where a rate of the command is not finite, all count as 0.
 * One call takes the place of flexcomp_step in a cycle; the two may alternate.
 *
 * CYCLE: as flexcomp_step; some three times its work. */
flexcomp_status flexcomp_step_rate(flexcomp_arm* fc, const flexcomp_real q_command_rad[FLEXCOMP_JOINTS],
                                   const flexcomp_real q_rate_command_rad_s[FLEXCOMP_JOINTS],
                                   const flexcomp_context* context,
                                   flexcomp_real q_corrected_rad[FLEXCOMP_JOINTS],
                                   flexcomp_real q_rate_corrected_rad_s[FLEXCOMP_JOINTS]);

/** What the last step did. */
typedef struct flexcomp_diagnostics {
  uint32_t struct_size;         /**< in: sizeof(flexcomp_diagnostics) */
  uint32_t cycles;              /**< since the start; wraps */
  uint32_t cycles_by_status[6]; /**< the same by flexcomp_status; wrap */
  flexcomp_status status;       /**< of the last step */
  uint32_t flags;               /**< of the last step, bits of flexcomp_step_flag */
  flexcomp_real
      remaining_position_m; /**< error of the tool, not less than the true one: what the last iterate leaves,
                                           and what offset and rate hold back; 0 without a set or where refused */
  flexcomp_real remaining_orientation_rad;       /**< the same of its orientation */
  flexcomp_real correction_rad[FLEXCOMP_JOINTS]; /**< output less command */
  flexcomp_real offset_rad[FLEXCOMP_JOINTS];     /**< the part of it that an event left; exactly 0 without */
  flexcomp_real direction[FLEXCOMP_JOINTS]; /**< of motion as tracked, -1 ... 1; 0 until a joint has moved */
} flexcomp_diagnostics;

/** Fills the diagnostics of the last step. 0, and nothing is written, where struct_size is not
 * sizeof(flexcomp_diagnostics). CYCLE, after the step; small. */
int flexcomp_get_diagnostics(const flexcomp_arm* fc, flexcomp_diagnostics* diagnostics);

/* --- at joint readings ----------------------------------------------------------------------------
 * Three calls on the set in use, with the directions of motion as the step tracks them. BOTH contexts, also at the
 * same time, and before the first step: they use the set that the cycle uses, or will with its next step, and
 * change nothing. In the background that set stays what it is until the next poll or command. `context` may be
 * NULL: the default one. No hook. */

/** Nominal command for joint readings (docs/compensation.md, C21): that which the active set corrects to
 * q_reading_rad. For the start, jogging, display and the following error; an offset that settles is not in it.
 * Nonzero where it is accurate to 1e-10 rad (float: 2e-6). 0, and the command as far as it came, where a number is
 * not finite (the reading comes back), beyond a joint limit, inside a singular region, where the step would limit
 * the correction, or where its rounds do not reach that accuracy. Without a set the readings themselves. BOTH
 * contexts; some six steps, 16 at most. In a cycle that has no time for them: in the background. */
int flexcomp_uncorrect(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                       const flexcomp_context* context, flexcomp_real q_command_rad[FLEXCOMP_JOINTS]);

/** True pose of the tool frame in F0 at joint readings, by the forward model with all effects (docs/model.md, M15):
 * origin, and Hamilton quaternion (w, x, y, z) with w >= 0. 0, and nothing is written, without a set or where a
 * number, of the arguments or of the result, is not finite. BOTH contexts; a pass. */
int flexcomp_tool_pose(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                       const flexcomp_context* context, flexcomp_real xyz_m[3], flexcomp_real wxyz[4]);

/** What loads do to the joints at their readings: torque about each joint by payload and external force, the
 * links' weight left out (docs/model.md, M11), and the angle by which all effects but constant ones turn it. 0, and
 * nothing is written, without a set or where a number, of the arguments or of the result, is not finite. BOTH contexts; a
 * pass. */
int flexcomp_joint_loads(const flexcomp_arm* fc, const flexcomp_real q_reading_rad[FLEXCOMP_JOINTS],
                         const flexcomp_context* context, flexcomp_real torque_nm[FLEXCOMP_JOINTS],
                         flexcomp_real deflection_rad[FLEXCOMP_JOINTS]);

/* --- the parameter store -------------------------------------------------------------------------- */

/** Background work of the store: checking and writing a set, trials, timeouts. Every 10 ms or so; the check of a
 * set takes 50 to 150 polls, a commit of n bytes n / 256 + 3 more. now_ms is any clock that wraps at 32 bits.
 * BACKGROUND; at most 20,000 instructions of a Cortex-M7 (default capacity) while a set is checked, else small, and
 * at most one `erase` or one `write` of 256 bytes with one `read` of as many. */
void flexcomp_poll(flexcomp_arm* fc, uint32_t now_ms);

/** State of the parameter store and the cycle. */
typedef struct flexcomp_state {
  uint32_t active_sequence;   /**< 0: none */
  uint32_t previous_sequence; /**< that rollback returns to, 0: none */
  uint32_t active_bytes;      /**< of the active image */
  uint32_t trial_cycles_left; /**< 0: no trial */
  uint32_t cycles;            /**< since the start; wraps */
  uint32_t detail;            /**< of the last answer or refusal */
  unsigned store;             /**< 0 idle, 1 receiving, 2 verified, 3 working, 4 trial */
  unsigned answer;            /**< to the last command; flexcomp_answer_text */
  unsigned refusal;           /**< of the last image; flexcomp_refusal_text */
  unsigned faults;            /**< bits: 1 no valid set, 2 older slot, 4 storage failed, 8 trial reverted */
} flexcomp_state;

/** Copies the state. BACKGROUND; small. */
void flexcomp_get_state(const flexcomp_arm* fc, flexcomp_state* state);

/** Command as the hook `permit` sees it: a transfer begins. */
#define FLEXCOMP_COMMAND_BEGIN 1
/** Command as the hook `permit` sees it: checks what is staged. */
#define FLEXCOMP_COMMAND_VERIFY 2
/** Command as the hook `permit` sees it: writes what is staged to a slot and activates it. */
#define FLEXCOMP_COMMAND_COMMIT 3
/** Command as the hook `permit` sees it: the same on trial. */
#define FLEXCOMP_COMMAND_COMMIT_TRIAL 4
/** Command of flexcomp_command(): makes the set on trial permanent. */
#define FLEXCOMP_COMMAND_CONFIRM 5
/** Command of flexcomp_command(): back to the set in the other slot, or out of the trial. */
#define FLEXCOMP_COMMAND_ROLLBACK 6
/** Command as the hook `permit` sees it: discards what is staged. */
#define FLEXCOMP_COMMAND_ABORT 7
/** Command of flexcomp_command(): erases both slots; commands are then passed through. */
#define FLEXCOMP_COMMAND_RESTORE_DEFAULTS 8
/** Command as the hook `permit` sees it: a client asks to roll back or restore, without a signature. */
#define FLEXCOMP_COMMAND_UNLOCK 9
/** A command from local control (an operator panel), numbers as on the wire. Returns the answer; the polls
 * that follow do the work. BACKGROUND; small, but for a rollback one `read` of an image and its check. */
unsigned flexcomp_command(flexcomp_arm* fc, unsigned command);

/* A set by bytes, for a fieldbus of the program's own (EtherCAT, PROFINET), a file or a panel. It is the same store
 * with the same checks as behind the buses; while one client stages, the others are told that it is busy. Answers
 * are those of the wire (flexcomp_answer_text): 0 accepted, 1 refused (flexcomp_state says why), others. All
 * BACKGROUND.
 *
 *     flexcomp_stage_begin(fc, size);
 *     flexcomp_stage_write(fc, 0, image, size);      once or in portions
 *     flexcomp_stage_verify(fc);                     may be left out: commit verifies as well
 *     flexcomp_stage_commit(fc);
 *
 * Verify and commit may answer before they have ended. After either, call flexcomp_poll until `store` of
 * flexcomp_state is no longer 3 (working); `answer`, `refusal` and `detail` then tell how it ended. */

/** Announces an image of `bytes`; what was staged before is dropped. Small, and clears FLEXCOMP_STAGING_BYTES. */
unsigned flexcomp_stage_begin(flexcomp_arm* fc, uint32_t bytes);
/** Bytes of the image from `offset`; portions may overlap what came before but leave no gap. Copies them: some
 * instructions per byte. */
unsigned flexcomp_stage_write(flexcomp_arm* fc, uint32_t offset, const uint8_t* bytes, uint32_t size);
/** Checks the image and prepares it. A check of the image, in this call or in the polls that follow. */
unsigned flexcomp_stage_verify(flexcomp_arm* fc);
/** Writes the image to the other slot and activates it, verified before where it was not. The polls do the work.
 * As flexcomp_stage_verify. */
unsigned flexcomp_stage_commit(flexcomp_arm* fc);
/** The same on trial: after so many control cycles (0: as trial_cycles says) the former set is active again unless
 * flexcomp_command(fc, FLEXCOMP_COMMAND_CONFIRM) comes before. */
unsigned flexcomp_stage_commit_trial(flexcomp_arm* fc, uint32_t cycles);
/** Discards what is staged. Small. */
unsigned flexcomp_stage_abort(flexcomp_arm* fc);

/** Name of a status as in files, lower case; any number is answered. ANY context; small. */
const char* flexcomp_status_text(flexcomp_status status);
/** Text of an answer in English, lower case, without a full stop; any number is answered. ANY context; small.
 * */
const char* flexcomp_answer_text(unsigned answer);
/** Text of a refusal in English, lower case, without a full stop; any number is answered. ANY context; small.
 * */
const char* flexcomp_refusal_text(unsigned refusal);
/** Version of the library, "major.minor.patch". ANY context; small. */
const char* flexcomp_version(void);

/* --- CANopen (CiA 301) --------------------------------------------------------------------------- */

/** Sends a data frame with an 11-bit identifier. 0 where the queue is full; it is offered again. Called
 * within flexcomp_can_receive and flexcomp_can_poll; puts the frame into a mailbox or a queue and does not
 * wait for it. */
typedef int (*flexcomp_can_send)(void* user, uint16_t id, const uint8_t* bytes, uint8_t size);

/** Builds a node (1 ... 127) with this heartbeat time (ms, 0: none) in `memory` of FLEXCOMP_CAN_BYTES. NULL
 * where an argument is out of range. At most one node per arm and bus. BACKGROUND, like all that follows;
 * small, no hook. */
flexcomp_can* flexcomp_can_init(void* memory, size_t size, flexcomp_arm* fc, unsigned node,
                                uint16_t heartbeat_ms, flexcomp_can_send send, void* user);
/** Takes a data frame with an 11-bit identifier from the bus; any may be given, and those of other nodes are
 * ignored. Not from the receive interrupt, if that may hold up the cycle: put frames into a queue there.
 * BACKGROUND; small and one frame sent, of a block upload eight, but for the frame that
 *   begins an image (clears FLEXCOMP_STAGING_BYTES),
 *   reads one (one `read` of up to 576 bytes),
 *   reads the answer to a probe (two steps),
 *   verifies or commits (a check of the image),
 *   rolls back (one `read`, and a check). */
void flexcomp_can_receive(flexcomp_can* can, uint16_t id, const uint8_t* bytes, size_t size);
/** Background work of a node: boot-up, heartbeat, EMCY, TPDO, timeouts, frames that could not be sent. Every few
 * milliseconds. BACKGROUND; small, at most 23 frames sent (eight for each of two SDO servers are segments of a block
 * upload, which pauses while the queue is full). */
void flexcomp_can_poll(flexcomp_can* can, uint32_t now_ms);
/** Copies the 8 bytes that were saved at last to `bytes`; 0 where there are none. */
typedef int (*flexcomp_can_load)(void* user, uint8_t* bytes);
/** Keeps 8 bytes in non-volatile memory; 0 where that failed. Called within flexcomp_can_receive, which waits for
 * it. */
typedef int (*flexcomp_can_save)(void* user, const uint8_t* bytes);
/** Memory for what the network has set up: heartbeat time (1017h) and inhibit time of EMCY (1015h), saved by
 * 1010h:2 and set back by 1011h:2. Before the first flexcomp_can_poll; what was saved holds at once, and after
 * each reset by the network. Without it both are as built after each reset, and 1010h:2 is refused (0601 0000h).
 * BACKGROUND; calls `load`. */
void flexcomp_can_set_memory(flexcomp_can* can, flexcomp_can_load load, flexcomp_can_save save, void* user);
/** Opens the second SDO server (1201h) with these COB-IDs, now and after each reset by the network: a channel for flexcomp
 * beside a master that has 1200h. Nonzero: done; 0: there is none, as without this call, because they are equal,
 * restricted (CiA 301, 7.3.5) or in use by this node. flexcomp's choice for nodes 1 ... 48 is 67Fh + node and 6AFh + node,
 * which are no other node's of the pre-defined connection set. BACKGROUND; small, no hook. */
int flexcomp_can_set_channel(flexcomp_can* can, unsigned request_id, unsigned answer_id);
/** COB-ID of requests to the second SDO server, which a master may set up or change by 1201h; 0: there is none. A driver
 * that filters lets this through beside 0 and 600h + node, and asks again after flexcomp_can_receive. BACKGROUND;
 * small, no hook. */
unsigned flexcomp_can_channel(const flexcomp_can* can);
/** Frames of an image that a client may send without an answer (SDO block download), 3 ... 63; 63 without this
 * call. Not more than your receive queue holds: what it loses is sent again, which takes time. 0: no block
 * transfers, which doubles the bus load of a push. BACKGROUND; small, no hook. */
void flexcomp_can_set_block_size(flexcomp_can* can, unsigned frames);

/* --- Modbus -------------------------------------------------------------------------------------- */

/** Sends bytes; called at most once per request, within the call that received it. The bytes are the
 * library's: copy them, or send them before returning. */
typedef void (*flexcomp_send)(void* user, const uint8_t* bytes, size_t size);

/** Builds a Modbus RTU line: unit 1 ... 247. gap_us is the silence that ends a frame: 1750 where bytes are
 * seen as they arrive (3.5 characters up to 19200 baud), more where they arrive in bursts. The receiver must be off
 * while sending. An answer is given as soon as the request is whole: `send` keeps the silence of 3.5 characters before
 * it (Modbus over Serial Line V1.02, 2.5.1.1) where the line is faster than the program. Another init in the same memory
 * ends the line that was there: what it staged is discarded. BACKGROUND; small, no hook. */
flexcomp_rtu* flexcomp_rtu_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit, uint32_t gap_us,
                                flexcomp_send send, void* user);
/** Takes bytes from the line, received until now_us (any clock that wraps at 32 bits), in any portions; the
 * sooner after the last byte of a request the call comes, the sooner the answer is sent. BACKGROUND; some
 * fifty instructions per byte, after noise some thousands per call, and per request what flexcomp_can_receive says. */
void flexcomp_rtu_receive(flexcomp_rtu* rtu, const uint8_t* bytes, size_t size, uint32_t now_us);
/** Ends frames at the gap. Every millisecond or so. BACKGROUND; small, or one request; after noise some fifty
 * instructions for each of at most 256 bytes. */
void flexcomp_rtu_poll(flexcomp_rtu* rtu, uint32_t now_us);
/** Tells that among the bytes last received the receiver lost characters (overrun nonzero) or saw a wrong parity or stop
 * bit (0): the frame that they are of is not used, and counted for Diagnostics. May be left out; the checksum finds what
 * is wrong. BACKGROUND; small. */
void flexcomp_rtu_line_error(flexcomp_rtu* rtu, int overrun);

/** Builds a Modbus TCP connection: one object per connection that may be open at a time. Another init in the same
 * memory (or reset) is for the next connection, and ends the one that was there: what it staged is discarded.
 * BACKGROUND; small, no hook. */
flexcomp_tcp* flexcomp_tcp_init(void* memory, size_t size, flexcomp_arm* fc, unsigned unit,
                                flexcomp_send send, void* user);
/** Takes bytes of the stream in any portions. 0 where it is not Modbus: close the connection. Which connections are
 * open, how long they may be idle, and which one gives way to a new one is the program's: docs/modbus.md.
 * BACKGROUND; as for RTU. */
int flexcomp_tcp_receive(flexcomp_tcp* tcp, const uint8_t* bytes, size_t size);
/** Ends a connection: discards what it staged; the object is ready for the next one. BACKGROUND; small. */
void flexcomp_tcp_reset(flexcomp_tcp* tcp);

#ifdef __cplusplus
}
#endif
/* NOLINTEND(modernize-use-using) */

#endif
