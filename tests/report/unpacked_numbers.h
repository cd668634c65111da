// SPDX-License-Identifier: Apache-2.0
// Reads the packed lists of a scene (report_scene.proto), written from its description alone.
#pragma once

#include <google/protobuf/io/gzip_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <cstdint>
#include <string>
#include <vector>

namespace sightline {

inline std::string UnpackBytes(const std::string& packed) {
  google::protobuf::io::ArrayInputStream source(packed.data(), static_cast<int>(packed.size()));
  google::protobuf::io::GzipInputStream stream(&source,
                                               google::protobuf::io::GzipInputStream::ZLIB);
  std::string bytes;
  const void* piece = nullptr;
  int size = 0;
  while (stream.Next(&piece, &size)) {
    bytes.append(static_cast<const char*>(piece), static_cast<size_t>(size));
  }
  return bytes;
}

template <class T>
std::vector<T> UnpackNumbers(const std::string& packed, size_t stride = 1) {
  const std::string bytes = UnpackBytes(packed);
  std::vector<T> numbers(bytes.size() / sizeof(T));
  for (size_t i = 0; i < numbers.size(); ++i) {
    uint64_t difference = 0;
    for (size_t byte = 0; byte < sizeof(T); ++byte) {
      difference |= static_cast<uint64_t>(static_cast<uint8_t>(bytes[byte * numbers.size() + i]))
                    << (8 * byte);
    }
    numbers[i] = static_cast<T>(difference + (i < stride ? T{0} : numbers[i - stride]));
  }
  return numbers;
}

}  // namespace sightline
