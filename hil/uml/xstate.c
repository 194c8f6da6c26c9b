/* SPDX-License-Identifier: Apache-2.0 */
// Loaded in front of user-mode Linux by hil/with-vcan.
//
// Linux takes a process's extended registers only in full (PTRACE_SETREGSET, NT_X86_XSTATE: "count != size" is
// EFAULT). User-mode Linux 6.1 knows 2696 bytes of them, up to AVX-512 and the protection keys; a processor with
// AMX has 11 KB, so its first process dies with "ptrace set fp regs failed, errno = 14". Here what it knows is
// laid over what the process has, and all of it is handed to the kernel.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>

enum { get_regset = 0x4204, set_regset = 0x4205, x86_xstate = 0x202 };

// Not on the stack: that of user-mode Linux is small. Not shared: it has one CPU and one thread.
static unsigned char all[65536];

long ptrace(int request, pid_t pid, void* address, void* data) {
  static long (*next)(int, ...);
  if (next == NULL) next = (long (*)(int, ...))dlsym(RTLD_NEXT, "ptrace");
  if (request == set_regset && address == (void*)x86_xstate) {
    const struct iovec* known = data;
    struct iovec whole = {all, sizeof all};
    if (next(get_regset, pid, address, &whole) == 0 && known->iov_len < whole.iov_len) {
      memcpy(all, known->iov_base, known->iov_len);
      return next(set_regset, pid, address, &whole);
    }
  }
  return next(request, pid, address, data);
}
