// SPDX-License-Identifier: Apache-2.0
// A vendor's library with two functions.
extern "C" {
__attribute__((visibility("default"))) int vendor_add(int a, int b) { return a + b; }
__attribute__((visibility("default"))) double vendor_half(double value) { return 0.5 * value; }
}
