// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "cell/cell_worker.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline {

/// The orders that hold for a whole cell (hint, forget, reload, recordings), each done here and
/// passed on. `cell` may return null: there is no other host then. What this host cannot do itself,
/// but others may, is passed on all the same.
void share_orders(HttpContent& content, std::function<std::shared_ptr<CellWorker>()> cell);

/// Does what another host passed on, by the functions of `content` before they were shared. Any
/// thread.
void obey(const CellOrder& order, const HttpContent& content);

}  // namespace sightline
