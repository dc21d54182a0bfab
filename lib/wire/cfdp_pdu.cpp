// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/cfdp_pdu.hpp"

#include <algorithm>
#include <cassert>
#include <limits>

#include "base/text.hpp"
#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

enum class Directive : std::uint8_t {
  eof = 0x04,
  finished = 0x05,
  ack = 0x06,
  metadata = 0x07,
  nak = 0x08,
  prompt = 0x09,
  keep_alive = 0x0C,
};

constexpr std::uint8_t version = 1;
constexpr std::size_t crc_octets = 2;
constexpr std::size_t lengths_octet = 3;  // place of the octet with the lengths of ids and sequence number

[[nodiscard]] bool fits(std::uint64_t value, std::size_t octets) {
  return octets >= 8 || value >> (8 * octets) == 0;
}
[[nodiscard]] std::size_t size_octets(const CfdpHeader& header) {
  return header.large_file ? 8 : 4;
}
[[nodiscard]] bool is_supported_length(std::size_t octets) {
  return octets == 1 || octets == 2 || octets == 4 || octets == 8;
}
[[nodiscard]] bool is_known(CfdpCondition condition) {
  const auto code = static_cast<std::uint8_t>(condition);
  return code <= 11 || code >= 14;
}

// ---- encoding -----------------------------------------------------------------------------------------

class Encoder {
 public:
  Encoder(const CfdpHeader& header, OctetWriter& out) : header_(header), out_(out) {}

  void operator()(const CfdpMetadata& m) {
    assert(m.source_file.size() <= cfdp_name_octets_max &&
           m.destination_file.size() <= cfdp_name_octets_max && m.checksum_type <= 15);
    directive(Directive::metadata);
    out_.u8(static_cast<std::uint8_t>((m.closure_requested ? 0x40U : 0U) | m.checksum_type));
    file_size(m.file_size);
    for (const std::string* name : {&m.source_file, &m.destination_file}) {
      out_.u8(static_cast<std::uint8_t>(name->size()));
      out_.bytes(as_octets(*name));
    }
    for (const CfdpTlv& option : m.options) tlv(option.type, option.value);
  }
  void operator()(const CfdpFileData& d) {
    assert(!d.data.empty());
    file_size(d.offset);
    out_.bytes(d.data);
  }
  void operator()(const CfdpEof& e) {
    directive(Directive::eof);
    out_.u8(static_cast<std::uint8_t>(static_cast<unsigned>(e.condition) << 4));
    out_.u32(e.checksum);
    file_size(e.file_size);
    fault_location(e.fault_location);
  }
  void operator()(const CfdpFinished& f) {
    directive(Directive::finished);
    out_.u8(static_cast<std::uint8_t>(static_cast<unsigned>(f.condition) << 4 | (f.incomplete ? 4U : 0U) |
                                      static_cast<unsigned>(f.file_status)));
    fault_location(f.fault_location);
  }
  void operator()(const CfdpAck& a) {
    directive(Directive::ack);
    const auto of = static_cast<unsigned>(a.of_finished ? Directive::finished : Directive::eof);
    out_.u8(static_cast<std::uint8_t>(of << 4 | (a.of_finished ? 1U : 0U)));
    out_.u8(
        static_cast<std::uint8_t>(static_cast<unsigned>(a.condition) << 4 | static_cast<unsigned>(a.status)));
  }
  void operator()(const CfdpNak& n) {
    directive(Directive::nak);
    segment(n.scope);
    for (const CfdpSegment& s : n.segments) segment(s);
  }
  void operator()(const CfdpPrompt& p) {
    directive(Directive::prompt);
    out_.u8(p.keep_alive ? 0x80 : 0);
  }
  void operator()(const CfdpKeepAlive& k) {
    directive(Directive::keep_alive);
    file_size(k.progress);
  }

 private:
  void directive(Directive code) { out_.u8(static_cast<std::uint8_t>(code)); }
  void file_size(std::uint64_t value) {
    assert(fits(value, size_octets(header_)));
    out_.put(value, size_octets(header_));
  }
  void segment(const CfdpSegment& s) {
    file_size(s.start);
    file_size(s.end);
  }
  void tlv(std::uint8_t type, OctetView value) {
    assert(value.size() <= 255);
    out_.u8(type);
    out_.u8(static_cast<std::uint8_t>(value.size()));
    out_.bytes(value);
  }
  void fault_location(const std::optional<std::uint64_t>& entity) {
    if (!entity) return;
    OctetWriter id(8);
    id.put(*entity, header_.entity_id_octets);
    tlv(CfdpTlv::fault_location, id.view());
  }

  const CfdpHeader& header_;
  OctetWriter& out_;
};

// ---- decoding -----------------------------------------------------------------------------------------

using Error = CfdpPduError;
template <class T>
using Decoded = Result<T, Error>;

/// What the two end PDUs have behind their fields: filestore responses (Finished only, passed over) and where
/// the fault was.
Decoded<std::optional<std::uint64_t>> read_fault_location(OctetReader& in, bool responses_allowed) {
  std::optional<std::uint64_t> entity;
  while (in.remaining() > 0) {
    const std::uint8_t type = in.u8();
    const OctetView value = in.bytes(in.u8());
    if (!in.ok()) return Err(Error::truncated);
    if (type == CfdpTlv::filestore_response && responses_allowed && !entity) continue;
    if (type != CfdpTlv::fault_location || entity || !is_supported_length(value.size())) {
      return Err(Error::bad_option);
    }
    entity = OctetReader(value).get(value.size());
  }
  return entity;
}

Decoded<CfdpBody> read_metadata(const CfdpHeader& header, OctetReader& in) {
  CfdpMetadata m;
  const std::uint8_t flags = in.u8();
  if ((flags & 0xB0U) != 0) return Err(Error::reserved_value);
  m.closure_requested = (flags & 0x40U) != 0;
  m.checksum_type = flags & 0x0FU;
  m.file_size = in.get(size_octets(header));
  for (std::string* name : {&m.source_file, &m.destination_file}) {
    const OctetView text = in.bytes(in.u8());
    name->assign(text.begin(), text.end());
  }
  if (!in.ok()) return Err(Error::truncated);
  while (in.remaining() > 0) {
    const std::uint8_t type = in.u8();
    const OctetView value = in.bytes(in.u8());
    if (!in.ok()) return Err(Error::truncated);
    if (type == CfdpTlv::filestore_request) return Err(Error::filestore_request);
    if (type != CfdpTlv::message_to_user && type != CfdpTlv::fault_handler_override &&
        type != CfdpTlv::flow_label) {
      return Err(Error::bad_option);
    }
    m.options.push_back({.type = type, .value = Octets(value.begin(), value.end())});
  }
  return m;
}

Decoded<CfdpBody> read_file_data(const CfdpHeader& header, OctetReader& in) {
  CfdpFileData d;
  d.offset = in.get(size_octets(header));
  if (!in.ok()) return Err(Error::truncated);
  d.data = in.rest();
  if (d.data.empty()) return Err(Error::empty_file_data);
  if (!fits(d.offset + d.data.size(), size_octets(header)) || d.offset + d.data.size() < d.offset) {
    return Err(Error::bad_segment);
  }
  return d;
}

Decoded<CfdpBody> read_eof(const CfdpHeader& header, OctetReader& in) {
  CfdpEof e;
  const std::uint8_t condition = in.u8();
  e.condition = static_cast<CfdpCondition>(condition >> 4);
  e.checksum = in.u32();
  e.file_size = in.get(size_octets(header));
  if (!in.ok()) return Err(Error::truncated);
  if ((condition & 0x0FU) != 0 || !is_known(e.condition)) return Err(Error::reserved_value);
  const auto location = read_fault_location(in, false);
  if (!location) return Err(location.error());
  e.fault_location = *location;
  return e;
}

Decoded<CfdpBody> read_finished(OctetReader& in) {
  CfdpFinished f;
  const std::uint8_t flags = in.u8();
  if (!in.ok()) return Err(Error::truncated);
  f.condition = static_cast<CfdpCondition>(flags >> 4);
  f.incomplete = (flags & 4U) != 0;
  f.file_status = static_cast<CfdpFileStatus>(flags & 3U);
  if ((flags & 8U) != 0 || !is_known(f.condition)) return Err(Error::reserved_value);
  const auto location = read_fault_location(in, true);
  if (!location) return Err(location.error());
  f.fault_location = *location;
  return f;
}

Decoded<CfdpBody> read_ack(OctetReader& in) {
  CfdpAck a;
  const std::uint8_t of = in.u8();
  const std::uint8_t flags = in.u8();
  if (!in.ok()) return Err(Error::truncated);
  const auto eof = static_cast<unsigned>(Directive::eof) << 4;
  // 727.0-B-5 has subtype 1 for Finished; some implementations send 0.
  const auto finished = static_cast<unsigned>(Directive::finished) << 4;
  if (of != eof && (of & 0xFEU) != finished) return Err(Error::reserved_value);
  a.of_finished = of != eof;
  a.condition = static_cast<CfdpCondition>(flags >> 4);
  a.status = static_cast<CfdpTransactionStatus>(flags & 3U);
  if ((flags & 0x0CU) != 0 || !is_known(a.condition)) return Err(Error::reserved_value);
  return a;
}

Decoded<CfdpBody> read_nak(const CfdpHeader& header, OctetReader& in) {
  const auto segment = [&] {
    const std::uint64_t start = in.get(size_octets(header));
    return CfdpSegment{.start = start, .end = in.get(size_octets(header))};
  };
  CfdpNak n;
  n.scope = segment();
  if (!in.ok()) return Err(Error::truncated);
  if (in.remaining() % (2 * size_octets(header)) != 0) return Err(Error::truncated);
  n.segments.reserve(in.remaining() / (2 * size_octets(header)));
  while (in.remaining() > 0) n.segments.push_back(segment());
  const auto backward = [](const CfdpSegment& s) { return s.end < s.start; };
  if (backward(n.scope) || std::any_of(n.segments.begin(), n.segments.end(), backward)) {
    return Err(Error::bad_segment);
  }
  return n;
}

Decoded<CfdpBody> read_prompt(OctetReader& in) {
  const std::uint8_t flags = in.u8();
  if (!in.ok()) return Err(Error::truncated);
  if ((flags & 0x7FU) != 0) return Err(Error::reserved_value);
  return CfdpPrompt{.keep_alive = flags != 0};
}

Decoded<CfdpBody> read_keep_alive(const CfdpHeader& header, OctetReader& in) {
  const CfdpKeepAlive k{.progress = in.get(size_octets(header))};
  if (!in.ok()) return Err(Error::truncated);
  return k;
}

Decoded<CfdpBody> read_directive(const CfdpHeader& header, OctetReader& in) {
  const std::uint8_t code = in.u8();
  if (!in.ok()) return Err(Error::truncated);
  switch (static_cast<Directive>(code)) {
    case Directive::eof:
      return read_eof(header, in);
    case Directive::finished:
      return read_finished(in);
    case Directive::ack:
      return read_ack(in);
    case Directive::metadata:
      return read_metadata(header, in);
    case Directive::nak:
      return read_nak(header, in);
    case Directive::prompt:
      return read_prompt(in);
    case Directive::keep_alive:
      return read_keep_alive(header, in);
  }
  return Err(Error::unknown_directive);
}

}  // namespace

std::string_view to_string(CfdpCondition condition) {
  switch (condition) {
    case CfdpCondition::no_error:
      return "no error";
    case CfdpCondition::positive_ack_limit:
      return "positive ACK limit reached";
    case CfdpCondition::keep_alive_limit:
      return "keep alive limit reached";
    case CfdpCondition::invalid_transmission_mode:
      return "invalid transmission mode";
    case CfdpCondition::filestore_rejection:
      return "filestore rejection";
    case CfdpCondition::file_checksum_failure:
      return "file checksum failure";
    case CfdpCondition::file_size_error:
      return "file size error";
    case CfdpCondition::nak_limit:
      return "NAK limit reached";
    case CfdpCondition::inactivity:
      return "inactivity detected";
    case CfdpCondition::invalid_file_structure:
      return "invalid file structure";
    case CfdpCondition::check_limit:
      return "check limit reached";
    case CfdpCondition::unsupported_checksum_type:
      return "unsupported checksum type";
    case CfdpCondition::suspend_request:
      return "suspend request received";
    case CfdpCondition::cancel_request:
      return "cancel request received";
  }
  return "?";
}

std::string_view to_string(CfdpPduError error) {
  switch (error) {
    case Error::too_short:
      return "ends within its header";
    case Error::bad_version:
      return "version is not 1";
    case Error::length_differs:
      return "length field and octets differ";
    case Error::bad_id_length:
      return "length of ids or sequence number is not 1, 2, 4 or 8";
    case Error::bad_crc:
      return "CRC is wrong";
    case Error::record_structure:
      return "record boundaries are not supported";
    case Error::segment_metadata:
      return "segment metadata is not supported";
    case Error::empty_file_data:
      return "file data without data";
    case Error::unknown_directive:
      return "unknown directive";
    case Error::wrong_direction:
      return "travels in the wrong direction";
    case Error::reserved_value:
      return "reserved bits or value";
    case Error::truncated:
      return "a field ends beyond the PDU";
    case Error::trailing_octets:
      return "octets after the last field";
    case Error::bad_option:
      return "misplaced option";
    case Error::filestore_request:
      return "filestore requests are not supported";
    case Error::bad_segment:
      return "impossible segment";
  }
  return "?";
}

bool is_toward_sender(const CfdpBody& body) {
  if (const auto* ack = std::get_if<CfdpAck>(&body)) return !ack->of_finished;
  return std::holds_alternative<CfdpFinished>(body) || std::holds_alternative<CfdpNak>(body) ||
         std::holds_alternative<CfdpKeepAlive>(body);
}

std::size_t cfdp_nak_segments_max(const CfdpHeader& header, std::size_t octets) {
  const std::size_t pair = 2 * size_octets(header);
  const std::size_t around = cfdp_header_octets(header) + 1 + pair + (header.crc ? crc_octets : 0);
  return octets < around ? 0 : (octets - around) / pair;
}

Octets encode_cfdp_pdu(const CfdpHeader& header, const CfdpBody& body) {
  assert(is_supported_length(header.entity_id_octets) && is_supported_length(header.sequence_number_octets));
  assert(fits(header.source_entity, header.entity_id_octets));
  assert(fits(header.destination_entity, header.entity_id_octets));
  assert(fits(header.sequence_number, header.sequence_number_octets));
  const std::size_t limit = cfdp_header_octets(header) + std::numeric_limits<std::uint16_t>::max();
  OctetWriter contents(limit);
  std::visit(Encoder(header, contents), body);
  const std::size_t length = contents.size() + (header.crc ? crc_octets : 0);
  assert(contents.ok() && length <= std::numeric_limits<std::uint16_t>::max());

  OctetWriter out(limit);
  out.u8(static_cast<std::uint8_t>(
      unsigned{version} << 5 | (std::holds_alternative<CfdpFileData>(body) ? 0x10U : 0U) |
      (is_toward_sender(body) ? 0x08U : 0U) | (header.unacknowledged ? 0x04U : 0U) |
      (header.crc ? 0x02U : 0U) | (header.large_file ? 0x01U : 0U)));
  out.u16(static_cast<std::uint16_t>(length));
  out.u8(
      static_cast<std::uint8_t>((header.entity_id_octets - 1U) << 4 | (header.sequence_number_octets - 1U)));
  out.put(header.source_entity, header.entity_id_octets);
  out.put(header.sequence_number, header.sequence_number_octets);
  out.put(header.destination_entity, header.entity_id_octets);
  out.bytes(contents.view());
  if (header.crc) out.u16(crc16(out.view()));
  return out.take();
}

Result<CfdpPdu, CfdpPduError> decode_cfdp_pdu(OctetView octets) {
  if (octets.size() < cfdp_fixed_header_octets) return Err(Error::too_short);
  const std::uint8_t flags = octets[0];
  const std::uint8_t lengths = octets[lengths_octet];
  if (flags >> 5 != version) return Err(Error::bad_version);
  CfdpHeader header;
  header.unacknowledged = (flags & 0x04U) != 0;
  header.crc = (flags & 0x02U) != 0;
  header.large_file = (flags & 0x01U) != 0;
  header.entity_id_octets = static_cast<std::uint8_t>((lengths >> 4 & 7U) + 1);
  header.sequence_number_octets = static_cast<std::uint8_t>((lengths & 7U) + 1);
  if (!is_supported_length(header.entity_id_octets) || !is_supported_length(header.sequence_number_octets)) {
    return Err(Error::bad_id_length);
  }
  const std::size_t length = static_cast<std::size_t>(octets[1]) << 8 | octets[2];
  if (octets.size() < cfdp_header_octets(header)) return Err(Error::too_short);
  if (octets.size() != cfdp_header_octets(header) + length) return Err(Error::length_differs);
  if (header.crc) {
    if (length < crc_octets) return Err(Error::truncated);
    if (crc16(octets) != 0) return Err(Error::bad_crc);
    octets = octets.first(octets.size() - crc_octets);
  }

  OctetReader in(octets.subspan(cfdp_fixed_header_octets));
  header.source_entity = in.get(header.entity_id_octets);
  header.sequence_number = in.get(header.sequence_number_octets);
  header.destination_entity = in.get(header.entity_id_octets);
  const bool is_file_data = (flags & 0x10U) != 0;
  // For directives the standard has the receiver ignore both flags (table 5-1).
  if (is_file_data && (lengths & 0x80U) != 0) return Err(Error::record_structure);
  if (is_file_data && (lengths & 0x08U) != 0) return Err(Error::segment_metadata);
  auto body = is_file_data ? read_file_data(header, in) : read_directive(header, in);
  if (!body) return Err(body.error());
  if (in.remaining() > 0) return Err(Error::trailing_octets);
  if (is_toward_sender(*body) != ((flags & 0x08U) != 0)) return Err(Error::wrong_direction);
  return CfdpPdu{.header = header, .body = std::move(*body)};
}

}  // namespace srfs::wire
