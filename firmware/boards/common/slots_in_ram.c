/* SPDX-License-Identifier: Apache-2.0 */
/* The two slots of flexcomp.h in plain memory, for boards without a driver for their flash: what is pushed is lost
 * with the power. They keep to the rules of flash (a slot is erased as a whole, which takes its time, and each unit is
 * then written once, as flash with a checksum per unit wants it), so that what works here works there. */
#include "slots_in_ram.h"

#include <string.h>

enum { erased = 0xFF, unit_bytes = 32, slot_units = FLEXCOMP_SLOT_BYTES / unit_bytes };
/* Of a slot with each call. */
enum { erase_bytes = 1024 };

static uint8_t slots[2][FLEXCOMP_SLOT_BYTES];
static uint8_t writable[2][slot_units];
static uint32_t erased_bytes[2];

static int within(unsigned slot, uint32_t offset, uint32_t size) {
  return slot < 2 && offset <= FLEXCOMP_SLOT_BYTES && size <= FLEXCOMP_SLOT_BYTES - offset;
}

static flexcomp_storage_result slot_read(void* user, unsigned slot, uint32_t offset, uint8_t* to,
                                         uint32_t size) {
  (void)user;
  if (!within(slot, offset, size)) return FLEXCOMP_STORAGE_FAILED;
  memcpy(to, &slots[slot][offset], size);
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result slot_erase(void* user, unsigned slot) {
  uint32_t left, size;
  (void)user;
  if (!within(slot, 0, FLEXCOMP_SLOT_BYTES)) return FLEXCOMP_STORAGE_FAILED;
  left = FLEXCOMP_SLOT_BYTES - erased_bytes[slot];
  size = left < erase_bytes ? left : erase_bytes;
  memset(&slots[slot][erased_bytes[slot]], erased, size);
  erased_bytes[slot] += size;
  memset(writable[slot], size == left, sizeof writable[slot]);
  if (size < left) return FLEXCOMP_STORAGE_BUSY;
  erased_bytes[slot] = 0;
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result slot_write(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  uint32_t unit;
  (void)user;
  if (!within(slot, offset, size) || offset % unit_bytes != 0 || size % unit_bytes != 0) {
    return FLEXCOMP_STORAGE_FAILED;
  }
  for (unit = offset / unit_bytes; unit < (offset + size) / unit_bytes; ++unit) {
    if (!writable[slot][unit]) return FLEXCOMP_STORAGE_FAILED;
    writable[slot][unit] = 0;
  }
  memcpy(&slots[slot][offset], from, size);
  return FLEXCOMP_STORAGE_DONE;
}

const flexcomp_storage flexcomp_slots_in_ram = {NULL, slot_read, slot_erase, slot_write};
