// SPDX-License-Identifier: Apache-2.0
// Before the decoders from npm: without these names they put themselves on `globalThis`.
var module, exports, define; // eslint-disable-line
