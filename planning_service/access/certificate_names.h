// SPDX-License-Identifier: Apache-2.0
// Names by which a client certificate identifies a client, the same for gRPC and HTTP.
//
// RFC 6125 6.4.4: if a certificate has subject alternative names, these alone count, and the common
// name does not. Without them the common name counts if there is exactly one: of several it is
// unknown which one the authority checked.
#pragma once

#include <openssl/types.h>

#include <string>
#include <string_view>
#include <vector>

namespace sightline {

// Alternative names of type DNS, URI, email and IP address (at most 100), or the common name. Names
// with control characters are left out: a NUL inside would let "admin\0.example" pass for another.
// A certificate whose alternative names cannot be read has no names.
std::vector<std::string> CertificateNames(const X509* certificate);

// As above, of the first certificate of a PEM text; empty if it has none.
std::vector<std::string> CertificateNamesOfPem(std::string_view pem);

}  // namespace sightline
