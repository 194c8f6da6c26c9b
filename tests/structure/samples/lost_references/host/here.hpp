// SPDX-License-Identifier: Apache-2.0
// See page.md section 1 and page.md, section 2; gone/gone.hpp, host/here.hpp.
const char* text = "not_a_comment.hpp";
