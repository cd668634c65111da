// SPDX-License-Identifier: Apache-2.0
#include "core/parallel/exception_status.h"

#include <exception>
#include <new>
#include <stdexcept>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sightline {

absl::Status StatusOfException() {
  try {
    throw;
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("out of memory");
  } catch (const std::length_error&) {
    // A container that was asked for more than any memory can hold.
    return absl::ResourceExhaustedError("out of memory");
  } catch (const std::system_error& error) {
    if (error.code() == std::errc::resource_unavailable_try_again ||
        error.code() == std::errc::not_enough_memory) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no more threads or memory: ", error.what()));
    }
    return absl::InternalError(absl::StrCat("exception: ", error.what()));
  } catch (const std::exception& error) {
    return absl::InternalError(absl::StrCat("exception: ", error.what()));
  } catch (...) {
    return absl::InternalError("exception of unknown type");
  }
}

}  // namespace sightline
