// SPDX-License-Identifier: Apache-2.0
#include "sightline/base/waiting.hpp"

namespace sightline {
namespace {

thread_local WaitListener* listener_of_thread = nullptr;
thread_local int depth = 0;

}  // namespace

Waiting::Waiting(const char* what) {
  if (depth++ == 0 && listener_of_thread != nullptr) listener_of_thread->wait_begins(what);
}

Waiting::~Waiting() {
  if (--depth == 0 && listener_of_thread != nullptr) listener_of_thread->wait_ends();
}

WaitListening::WaitListening(WaitListener& listener) { listener_of_thread = &listener; }

WaitListening::~WaitListening() { listener_of_thread = nullptr; }

}  // namespace sightline
