// SPDX-License-Identifier: Apache-2.0
// See page.md section 1 and <string.h>, https://example.org/gone.hpp and build/gone.hpp.
const char* text = "not_a_comment.hpp";
