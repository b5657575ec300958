// SPDX-License-Identifier: BSD-3-Clause
//
// What was computed last, kept for whoever asks for the same again; for several threads.
#pragma once

#include <algorithm>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>

namespace ves {

/// The newest `Kept` values by their keys, compared with ==.
template <class Key, class Value, std::size_t Kept>
class Memo {
 public:
  /// The value of a key: kept, or now computed by compute(). Who asks for one that another thread
  /// is at waits for it. What compute() throws is passed on, and nothing is kept.
  template <class Compute>
  std::shared_ptr<const Value> of(const Key& key, const Compute& compute) {
    const std::shared_ptr<Entry> entry = entryOf(key);
    std::call_once(entry->once, [&] { entry->value.emplace(compute()); });
    return {entry, &*entry->value};
  }

 private:
  struct Entry {
    explicit Entry(const Key& k) : key(k) {}
    Key key;
    std::once_flag once;
    std::optional<Value> value;
  };

  std::shared_ptr<Entry> entryOf(const Key& key) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto at = std::find_if(entries_.begin(), entries_.end(),
                                 [&](const auto& entry) { return entry->key == key; });
    if (at != entries_.end()) return *at;
    if (entries_.size() == Kept) entries_.pop_front();
    return entries_.emplace_back(std::make_shared<Entry>(key));
  }

  std::mutex mutex_;
  std::deque<std::shared_ptr<Entry>> entries_;
};

}  // namespace ves
