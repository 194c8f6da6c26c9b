// SPDX-License-Identifier: Apache-2.0
// docs/page.md
