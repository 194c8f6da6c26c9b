// SPDX-License-Identifier: Apache-2.0
const char* text() { return "--joints LOG.csv"; }
