// SPDX-License-Identifier: Apache-2.0
// The one source of the targets that own the precompiled headers.
