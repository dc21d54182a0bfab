// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/deflate.hpp"

#include <cstdlib>

#include <zlib.h>

namespace srfs::update {
namespace {

constexpr int raw_window_bits = -15;  // 32 KiB, no zlib header
constexpr int most_memory = 9;

}  // namespace

Octets shrink(OctetView data) {
  z_stream state{};
  // Fails for lack of memory only.
  if (deflateInit2(&state, Z_BEST_COMPRESSION, Z_DEFLATED, raw_window_bits, most_memory,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    std::abort();
  Octets stream(deflateBound(&state, static_cast<uLong>(data.size())));
  state.next_in = const_cast<Bytef*>(data.data());
  state.avail_in = static_cast<uInt>(data.size());
  state.next_out = stream.data();
  state.avail_out = static_cast<uInt>(stream.size());
  if (::deflate(&state, Z_FINISH) != Z_STREAM_END) std::abort();  // deflateBound() is enough for one call
  stream.resize(state.total_out);
  deflateEnd(&state);
  return stream;
}

Result<Octets, DeflateError> expand(OctetView stream, std::size_t octets) {
  z_stream state{};
  if (inflateInit2(&state, raw_window_bits) != Z_OK) std::abort();
  Octets data(octets + 1);  // one more: too much is seen
  state.next_in = const_cast<Bytef*>(stream.data());
  state.avail_in = static_cast<uInt>(stream.size());
  state.next_out = data.data();
  state.avail_out = static_cast<uInt>(data.size());
  const int end = ::inflate(&state, Z_FINISH);
  const bool all_read = state.avail_in == 0;
  const std::size_t expanded = state.total_out;
  inflateEnd(&state);
  if (expanded > octets) return Err(DeflateError::too_long);
  if (end != Z_STREAM_END) return Err(DeflateError::damaged);
  if (expanded < octets) return Err(DeflateError::too_short);
  if (!all_read) return Err(DeflateError::trailing);
  data.resize(octets);
  return data;
}

}  // namespace srfs::update
