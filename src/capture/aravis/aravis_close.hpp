// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture/aravis/aravis_ref.hpp"

namespace sightline::capture {

/// Gives up a camera that does not answer, in a thread of its own. Aravis asks it for several
/// seconds to take control back; the caller has no time for that: it reports the loss and tries to
/// open the camera again. The thread ends within about 6 s.
void close_in_background(ObjectRef<ArvStream> stream, ObjectRef<ArvCamera> camera);
void close_in_background(ObjectRef<ArvDevice> device);

}  // namespace sightline::capture
