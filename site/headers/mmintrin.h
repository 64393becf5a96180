/* SPDX-License-Identifier: Apache-2.0 */
/* MMX: Eigen includes it and uses nothing of it; emscripten has none. */
