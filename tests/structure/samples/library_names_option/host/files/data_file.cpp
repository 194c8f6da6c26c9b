// SPDX-License-Identifier: Apache-2.0
const char* text() { return "these look like radians (--force takes them as degrees)"; }
