// SPDX-License-Identifier: Apache-2.0
#include <arpa/inet.h>
#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rand.h>
#include <openssl/x509v3.h>

#include <array>
#include <ctime>
#include <memory>

#include "sightline/publish/cell/certificates.hpp"

namespace sightline {
namespace {

template <auto kFree>
struct Free {
  template <typename T>
  void operator()(T* pointer) const {
    kFree(pointer);
  }
};
using Certificate = std::unique_ptr<X509, Free<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Free<EVP_PKEY_free>>;
using Memory = std::unique_ptr<BIO, Free<BIO_free>>;
using List = std::unique_ptr<X509_CRL, Free<X509_CRL_free>>;
using Entry = std::unique_ptr<X509_REVOKED, Free<X509_REVOKED_free>>;
using Number = std::unique_ptr<ASN1_INTEGER, Free<ASN1_INTEGER_free>>;
using Moment = std::unique_ptr<ASN1_TIME, Free<ASN1_TIME_free>>;
using Extension = std::unique_ptr<X509_EXTENSION, Free<X509_EXTENSION_free>>;

constexpr long kVersion3 = 2;  // as X.509 counts
constexpr size_t kSerialBytes = 16;
constexpr long kClocksApart_s = 86400;  // hosts whose clocks are behind take it too
constexpr long kDay_s = 86400;

Error failure(const std::string& subject, const char* tried) {
  std::array<char, 256> text{};
  ERR_error_string_n(ERR_get_error(), text.data(), text.size());
  ERR_clear_error();
  return make_error(ErrorCode::kInternal, subject, "cannot {}: {}", tried, text.data());
}

bool extend(X509& certificate, X509& issuer, int kind, const std::string& value) {
  X509V3_CTX context;
  X509V3_set_ctx(&context, &issuer, &certificate, nullptr, nullptr, 0);
  const Extension extension(X509V3_EXT_conf_nid(nullptr, &context, kind, value.c_str()));
  return extension && X509_add_ext(&certificate, extension.get(), -1) == 1;
}

bool is_address(const std::string& text) {
  std::array<unsigned char, sizeof(in6_addr)> ignored{};
  return inet_pton(AF_INET, text.c_str(), ignored.data()) == 1 ||
         inet_pton(AF_INET6, text.c_str(), ignored.data()) == 1;
}

std::string alternative_names(const std::vector<std::string>& addresses) {
  std::string list;
  for (const std::string& address : addresses) {
    list += fmt::format("{}{}{}", list.empty() ? "" : ",",
                        is_address(address) ? "IP:" : "DNS:", address);
  }
  return list;
}

// A number that nobody guesses, positive.
bool number(X509& certificate) {
  std::array<unsigned char, kSerialBytes> bytes{};
  if (RAND_bytes(bytes.data(), static_cast<int>(bytes.size())) != 1) return false;
  bytes[0] = static_cast<unsigned char>((bytes[0] & 0x7fU) | 0x40U);
  BIGNUM* const value = BN_bin2bn(bytes.data(), static_cast<int>(bytes.size()), nullptr);
  const bool set =
      value != nullptr && BN_to_ASN1_INTEGER(value, X509_get_serialNumber(&certificate)) != nullptr;
  BN_free(value);
  return set;
}

// What both kinds have in common, with a new key.
bool fill(X509& certificate, EVP_PKEY& key, const CertificateSubject& subject) {
  X509_NAME* const name = X509_get_subject_name(&certificate);
  const auto* const text = reinterpret_cast<const unsigned char*>(subject.name.c_str());
  return X509_set_version(&certificate, kVersion3) == 1 && number(certificate) &&
         X509_gmtime_adj(X509_getm_notBefore(&certificate), -kClocksApart_s) != nullptr &&
         X509_gmtime_adj(X509_getm_notAfter(&certificate), kDay_s * subject.days) != nullptr &&
         X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_UTF8, text, -1, -1, 0) == 1 &&
         X509_set_pubkey(&certificate, &key) == 1;
}

bool describe_authority(X509& certificate) {
  return extend(certificate, certificate, NID_basic_constraints, "critical,CA:TRUE,pathlen:0") &&
         extend(certificate, certificate, NID_key_usage, "critical,keyCertSign,cRLSign") &&
         extend(certificate, certificate, NID_subject_key_identifier, "hash");
}

// A client's certificate is no server's, so that no host can pose as the broker.
bool describe_host(X509& certificate, X509& issuer, const CertificateSubject& subject) {
  const bool server = !subject.addresses.empty();
  return extend(certificate, issuer, NID_basic_constraints, "critical,CA:FALSE") &&
         extend(certificate, issuer, NID_key_usage, "critical,digitalSignature") &&
         extend(certificate, issuer, NID_ext_key_usage, server ? "serverAuth" : "clientAuth") &&
         extend(certificate, issuer, NID_subject_key_identifier, "hash") &&
         extend(certificate, issuer, NID_authority_key_identifier, "keyid:always") &&
         (!server ||
          extend(certificate, issuer, NID_subject_alt_name, alternative_names(subject.addresses)));
}

std::string text_of(BIO& memory) {
  char* data = nullptr;
  const long size = BIO_get_mem_data(&memory, &data);
  return {data, static_cast<size_t>(size)};
}

Result<PemPair> to_pem(X509& certificate, EVP_PKEY& key, const std::string& subject) {
  const Memory first(BIO_new(BIO_s_mem())), second(BIO_new(BIO_s_secmem()));
  const bool written =
      first && second && PEM_write_bio_X509(first.get(), &certificate) == 1 &&
      PEM_write_bio_PKCS8PrivateKey(second.get(), &key, nullptr, nullptr, 0, nullptr, nullptr) == 1;
  if (!written) return failure(subject, "write the certificate");
  return PemPair{text_of(*first), text_of(*second)};
}

Certificate read_certificate(const std::string& pem) {
  const Memory memory(BIO_new_mem_buf(pem.data(), static_cast<int>(pem.size())));
  return Certificate(memory ? PEM_read_bio_X509(memory.get(), nullptr, nullptr, nullptr) : nullptr);
}

struct Parsed {
  Certificate certificate;
  Key key;
};

Result<Parsed> parse(const PemPair& pem) {
  const Memory second(BIO_new_mem_buf(pem.key.data(), static_cast<int>(pem.key.size())));
  Parsed parsed;
  parsed.certificate = read_certificate(pem.certificate);
  if (second) parsed.key.reset(PEM_read_bio_PrivateKey(second.get(), nullptr, nullptr, nullptr));
  if (!parsed.certificate || !parsed.key)
    return failure("the authority", "read its certificate and key");
  if (X509_check_private_key(parsed.certificate.get(), parsed.key.get()) != 1) {
    return failure("the authority", "use this key with this certificate");
  }
  return parsed;
}

Moment moment(long from_now_s) { return Moment(X509_gmtime_adj(nullptr, from_now_s)); }

bool add_revoked(X509_CRL& list, const X509& certificate) {
  Entry entry(X509_REVOKED_new());
  const Moment now = moment(0);
  const bool added =
      entry && now &&
      X509_REVOKED_set_serialNumber(
          entry.get(), const_cast<ASN1_INTEGER*>(X509_get0_serialNumber(&certificate))) == 1 &&
      X509_REVOKED_set_revocationDate(entry.get(), now.get()) == 1 &&
      X509_CRL_add0_revoked(&list, entry.get()) == 1;
  if (added) (void)entry.release();  // it is the list's
  return added;
}

// What RFC 5280 (5.1, 5.2) wants of it. Its number has to grow: the time does.
bool describe_list(X509_CRL& list, X509& issuer, int days) {
  const Moment begin = moment(-kClocksApart_s), end = moment(kDay_s * days), now = moment(0);
  const Number count(ASN1_INTEGER_new());
  X509V3_CTX context;
  X509V3_set_ctx(&context, &issuer, nullptr, nullptr, &list, 0);
  const Extension key(
      X509V3_EXT_conf_nid(nullptr, &context, NID_authority_key_identifier, "keyid:always"));
  return begin && end && now && count && key && X509_CRL_set_version(&list, 1) == 1 &&
         X509_CRL_set_issuer_name(&list, X509_get_subject_name(&issuer)) == 1 &&
         X509_CRL_set1_lastUpdate(&list, begin.get()) == 1 &&
         X509_CRL_set1_nextUpdate(&list, end.get()) == 1 &&
         X509_CRL_add_ext(&list, key.get(), -1) == 1 &&
         ASN1_INTEGER_set_uint64(count.get(), static_cast<uint64_t>(std::time(nullptr))) == 1 &&
         X509_CRL_add1_ext_i2d(&list, NID_crl_number, count.get(), 0, 0) == 1;
}

}  // namespace

Result<PemPair> make_authority(const CertificateSubject& subject) {
  const Certificate certificate(X509_new());
  const Key key(EVP_EC_gen("P-256"));
  const bool made =
      certificate && key && fill(*certificate, *key, subject) &&
      X509_set_issuer_name(certificate.get(), X509_get_subject_name(certificate.get())) == 1 &&
      describe_authority(*certificate) && X509_sign(certificate.get(), key.get(), EVP_sha256()) > 0;
  if (!made) return failure(subject.name, "make the authority's certificate");
  return to_pem(*certificate, *key, subject.name);
}

Result<PemPair> make_certificate(const CertificateSubject& subject, const PemPair& authority) {
  SL_ASSIGN(const Parsed issuer, parse(authority));
  const Certificate certificate(X509_new());
  const Key key(EVP_EC_gen("P-256"));
  const bool made = certificate && key && fill(*certificate, *key, subject) &&
                    X509_set_issuer_name(certificate.get(),
                                         X509_get_subject_name(issuer.certificate.get())) == 1 &&
                    describe_host(*certificate, *issuer.certificate, subject) &&
                    X509_sign(certificate.get(), issuer.key.get(), EVP_sha256()) > 0;
  if (!made) return failure(subject.name, "make its certificate");
  return to_pem(*certificate, *key, subject.name);
}

Result<std::string> make_revocation_list(const std::vector<std::string>& revoked,
                                         const PemPair& authority, int days) {
  SL_ASSIGN(const Parsed issuer, parse(authority));
  const List list(X509_CRL_new());
  if (!list || !describe_list(*list, *issuer.certificate, days)) {
    return failure("the authority", "make the list of what it takes back");
  }
  for (const std::string& pem : revoked) {
    const Certificate certificate = read_certificate(pem);
    if (!certificate || !add_revoked(*list, *certificate)) {
      return failure("the authority", "take a certificate back");
    }
  }
  const Memory memory(BIO_new(BIO_s_mem()));
  const bool made = X509_CRL_sort(list.get()) == 1 &&
                    X509_CRL_sign(list.get(), issuer.key.get(), EVP_sha256()) > 0 && memory &&
                    PEM_write_bio_X509_CRL(memory.get(), list.get()) == 1;
  if (!made) return failure("the authority", "sign the list of what it takes back");
  return text_of(*memory);
}

}  // namespace sightline
