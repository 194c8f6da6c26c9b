/* The two slots of flexcomp.h in plain memory, for boards without a driver for their flash: what is pushed is lost
 * with the power. They keep to the rules of flash (a slot is erased as a whole, and each byte is then written once),
 * so that what works here works there. */
#include "slots_in_ram.h"

#include <string.h>

enum { erased = 0xFF };

static uint8_t slots[2][FLEXCOMP_SLOT_BYTES];

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
  (void)user;
  if (!within(slot, 0, FLEXCOMP_SLOT_BYTES)) return FLEXCOMP_STORAGE_FAILED;
  memset(slots[slot], erased, FLEXCOMP_SLOT_BYTES);
  return FLEXCOMP_STORAGE_DONE;
}

static flexcomp_storage_result slot_write(void* user, unsigned slot, uint32_t offset, const uint8_t* from,
                                          uint32_t size) {
  uint32_t k;
  (void)user;
  if (!within(slot, offset, size)) return FLEXCOMP_STORAGE_FAILED;
  for (k = 0; k < size; ++k) {
    if (slots[slot][offset + k] != erased) return FLEXCOMP_STORAGE_FAILED;
  }
  memcpy(&slots[slot][offset], from, size);
  return FLEXCOMP_STORAGE_DONE;
}

const flexcomp_storage flexcomp_slots_in_ram = {NULL, slot_read, slot_erase, slot_write};
