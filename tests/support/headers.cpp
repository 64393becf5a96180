// SPDX-License-Identifier: Apache-2.0
// Nothing: the program of which the tests take the precompiled headers needs a source.
