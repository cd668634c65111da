// SPDX-License-Identifier: Apache-2.0
#include "report/document/packed_numbers.h"

#include <google/protobuf/io/gzip_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace sightline {
namespace {

template <class T>
std::string Pack(std::span<const T> numbers, size_t stride) {
  std::string bytes(numbers.size() * sizeof(T), '\0');
  for (size_t i = 0; i < numbers.size(); ++i) {
    const T before = i < stride ? T{0} : numbers[i - stride];
    const auto difference = static_cast<T>(numbers[i] - before);
    for (size_t byte = 0; byte < sizeof(T); ++byte) {
      bytes[byte * numbers.size() + i] =
          static_cast<char>(static_cast<uint64_t>(difference) >> (8 * byte) & 0xff);
    }
  }
  return PackBytes(bytes);
}

}  // namespace

std::string PackNumbers(std::span<const uint8_t> numbers, size_t stride) {
  return Pack(numbers, stride);
}

std::string PackNumbers(std::span<const uint16_t> numbers, size_t stride) {
  return Pack(numbers, stride);
}

std::string PackNumbers(std::span<const uint32_t> numbers, size_t stride) {
  return Pack(numbers, stride);
}

std::string PackBytes(absl::string_view bytes) {
  std::string packed;
  {
    google::protobuf::io::StringOutputStream text(&packed);
    google::protobuf::io::GzipOutputStream::Options options;
    options.format = google::protobuf::io::GzipOutputStream::ZLIB;
    options.compression_level = 9;
    google::protobuf::io::GzipOutputStream stream(&text, options);
    void* room = nullptr;
    int size = 0;
    while (!bytes.empty() && stream.Next(&room, &size)) {
      const size_t taken = std::min(bytes.size(), static_cast<size_t>(size));
      std::memcpy(room, bytes.data(), taken);
      bytes.remove_prefix(taken);
      if (taken < static_cast<size_t>(size)) {
        stream.BackUp(static_cast<int>(static_cast<size_t>(size) - taken));
      }
    }
    stream.Close();
  }
  return packed;
}

}  // namespace sightline
