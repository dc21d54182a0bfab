// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/archive/gap_finder.hpp"
#include "ground/archive/minutes.hpp"
#include "ground/downlink.hpp"
#include "wire/pus.hpp"

namespace srfs::ground {

/// A period; open ends where nullopt.
struct Period {
  std::optional<UtcTime> from;
  std::optional<UtcTime> to;  ///< not included
};

struct StoredPacket {
  std::int64_t id = 0;
  UtcTime received;        ///< the first copy
  bool live = false;       ///< a copy came live
  bool retrieved = false;  ///< a copy came from the packet store on board
  ReceivedPacket packet;
};

/// One telecommand as it was ordered.
struct TelecommandEntry {
  std::string token;  ///< of the client, unique: an order that is repeated is found by it
  wire::RequestId request;
  UtcTime sent = {};
  std::string who = {};
  std::string name;
  std::vector<std::string> arguments;
  bool ad = false;
  bool scheduled = false;  ///< a packet for the schedule on board; its insertion is an entry of its own
};

/// What became of it: the verification reports (PUS 1) that name it.
struct StoredTelecommand {
  std::int64_t id = 0;
  TelecommandEntry entry;
  struct Report {
    UtcTime time;  ///< of the spacecraft
    UtcTime received;
    std::uint8_t subtype = 0;
    Octets source;  ///< request id, then what the subtype adds
  };
  std::vector<Report> reports;  ///< in the order of their coming
};

struct FileEntry {
  UtcTime time;
  std::string transaction;
  std::string direction;
  std::string name;
  std::string event;
  std::optional<std::uint64_t> octets;
};

struct Pass {
  std::int64_t id = 0;
  UtcTime began;
  UtcTime ended;
  std::uint64_t packets = 0;
};

enum class GapState : std::uint8_t {
  open,
  filled,
  given_up,  ///< retrieved, and the spacecraft does not have them
};
[[nodiscard]] std::string_view to_text(GapState state);

struct StoredGap {
  std::int64_t id = 0;
  Gap gap;
  std::uint32_t missing = 0;  ///< not found yet; of a gap without count: 1 while it is open
  std::uint32_t attempts = 0;
  GapState state = GapState::open;
};

/// An operator has seen an event.
struct Acknowledgement {
  UtcTime time;
  std::string who;
};

struct PacketFilter {
  Period period = {};
  std::optional<std::uint16_t> apid = {};
  std::optional<std::uint8_t> service = {};
  std::optional<std::uint8_t> subtype = {};
  std::optional<std::uint16_t> structure = {};  ///< of housekeeping (3,25) or an event (5,x): its number
  std::optional<std::int64_t> after_id = {};    ///< packets that were received later than this one
  std::optional<std::int64_t> before_id = {};   ///< packets whose time is before that of this one
  bool newest_first = false;
  bool latest_live =
      false;  ///< live packets alone, what was received last first, whatever the spacecraft's clock says
  std::size_t most = SIZE_MAX;
};

/// The memory of a station, or of all stations of a spacecraft. Raw packets are the truth; everything that a
/// dictionary explains is made of them. One object is of one thread, and inside of a callback it is not used.
/// The errors are ready to print.
class Archive {
 public:
  using Outcome = Result<void, std::string>;
  Archive() = default;
  virtual ~Archive() = default;
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;

  // Writing. What is added is in the archive, whatever happens to the process, when commit() has returned;
  // a telecommand also after a power failure.
  /// Live and retrieved copies of a packet are one. @return its number when it is new; 0: it was there
  [[nodiscard]] virtual Result<std::int64_t, std::string> add(const ReceivedPacket& packet,
                                                              UtcTime received) = 0;
  [[nodiscard]] virtual Outcome add(const TelecommandEntry& telecommand) = 0;
  [[nodiscard]] virtual Outcome add(const FileEntry& file) = 0;
  /// @return whether that packet is an event, not acknowledged before
  [[nodiscard]] virtual Result<bool, std::string> acknowledge(std::int64_t packet,
                                                              const Acknowledgement& acknowledgement) = 0;
  /// An error of any writing loses what was added since the last commit; of its packets, a gap is found.
  /// @return whether there was anything to commit
  [[nodiscard]] virtual Result<bool, std::string> commit() = 0;
  /// The telecommand with this token stays as one that was not sent; the token may be used again.
  [[nodiscard]] virtual Outcome forget_token(const std::string& token) = 0;
  /// The request of a telecommand that was recorded with this token.
  [[nodiscard]] virtual Result<std::optional<wire::RequestId>, std::string> request_of(
      const std::string& token) = 0;
  /// A retrieval of what is missing in a gap begins: from now on it grows no more.
  [[nodiscard]] virtual Outcome count_attempt(std::int64_t gap) = 0;
  /// All stores were retrieved completely: what is still missing is not to be had.
  [[nodiscard]] virtual Outcome close_gap(std::int64_t gap) = 0;
  /// It is not tried any more.
  [[nodiscard]] virtual Outcome give_up_gap(std::int64_t gap) = 0;

  // Minutes: made of raw packets, later.
  struct DirtyMinute {
    std::uint16_t structure = 0;
    std::int64_t minute = 0;  ///< since 1970
  };
  /// The oldest minute whose aggregates are not made yet, and that began before @p before. When there is one,
  /// nobody else makes it and no packet of it comes until the commit.
  [[nodiscard]] virtual Result<std::optional<DirtyMinute>, std::string> dirty_minute(UtcTime before) = 0;
  /// Of a minute whose packets were removed in part, the aggregates of more packets stay.
  [[nodiscard]] virtual Outcome set_minute(const DirtyMinute& minute,
                                           const std::map<std::string, Aggregate>& aggregates) = 0;
  /// All aggregates whose packets are here are made anew, by a corrected dictionary.
  [[nodiscard]] virtual Outcome forget_minutes() = 0;

  // Reading.
  /// @param take  false: enough
  [[nodiscard]] virtual Outcome packets(const PacketFilter& filter,
                                        const std::function<bool(const StoredPacket&)>& take) = 0;
  /// At most filter.most; no more are looked at.
  [[nodiscard]] virtual Result<std::uint64_t, std::string> count(const PacketFilter& filter) = 0;
  [[nodiscard]] virtual Result<std::vector<StoredTelecommand>, std::string> telecommands(
      const Period& period, std::size_t most) = 0;
  /// The newest telecommand with this request that was sent before @p before, without its reports. Request
  /// ids come again, after 16384 telecommands of a process.
  [[nodiscard]] virtual Result<std::optional<StoredTelecommand>, std::string> telecommand_of(
      const wire::RequestId& request, UtcTime before) = 0;
  [[nodiscard]] virtual Result<std::optional<Acknowledgement>, std::string> acknowledgement_of(
      std::int64_t packet) = 0;
  /// The number of the packet that came last; 0: there is none.
  [[nodiscard]] virtual Result<std::int64_t, std::string> newest_packet() = 0;
  [[nodiscard]] virtual Result<std::vector<Point>, std::string> minutes(const std::string& parameter,
                                                                        const Period& period) = 0;
  /// Minutes of a structure in this period whose aggregates are not made yet.
  [[nodiscard]] virtual Result<std::vector<std::int64_t>, std::string> dirty_minutes(
      std::uint16_t structure, const Period& period) = 0;
  [[nodiscard]] virtual Result<std::vector<StoredGap>, std::string> gaps(const Period& period,
                                                                         bool open_alone) = 0;
  [[nodiscard]] virtual Result<std::vector<Pass>, std::string> passes(const Period& period) = 0;
  [[nodiscard]] virtual Result<std::vector<FileEntry>, std::string> files(const Period& period) = 0;

  // Care.
  /// What is wrong with the file; empty: nothing.
  [[nodiscard]] virtual Result<std::vector<std::string>, std::string> check() = 0;
  /// Removes what is older; never the newest packet, whose number is not given again. @return how many rows
  [[nodiscard]] virtual Result<std::uint64_t, std::string> prune(const std::string& table,
                                                                 UtcTime before) = 0;
};

inline constexpr std::string_view archive_name = "archive.sqlite";  ///< in STATE
inline constexpr std::int64_t archive_schema = 4;                   ///< of an SQLite file

/// Where an archive is, and for whom.
struct ArchivePlace {
  ArchivePlace() = default;
  /// An SQLite file.
  ArchivePlace(const std::filesystem::path& file)
      : address(file.string()) {}  // NOLINT(google-explicit-constructor)
  /// @param address_given  postgresql://...: an archive for each spacecraft, that its stations share
  ArchivePlace(std::string address_given, int spacecraft_id, unsigned station_number)
      : address(std::move(address_given)), spacecraft(spacecraft_id), station(station_number) {}

  std::string address;
  int spacecraft = 0;    ///< its identifier, of a PostgreSQL
  unsigned station = 0;  ///< that writes, of a PostgreSQL
  /// Of a station, for a transaction in a PostgreSQL; a fifth of it for a new connection.
  milliseconds patience{1000};
};
/// Whether it is a PostgreSQL, which several programs write.
[[nodiscard]] bool is_shared(const ArchivePlace& place);
/// Why its address cannot be used, whether the archive is there or not; nullopt: it can. Ready to print, and
/// without a password that may be in it.
[[nodiscard]] std::optional<std::string> wrong_address(const ArchivePlace& place);

enum class ArchiveUse : std::uint8_t {
  read,
  write,  ///< by a station, whose loop waits for it
  care,   ///< by a command
  merge   ///< by a command that adds another archive's rows; an older archive is refused
};
/// The schema of a file that open_archive() will bring up to date; nullopt: none.
[[nodiscard]] std::optional<std::int64_t> older_schema(const ArchivePlace& place);
/// Opens or makes an archive, and brings an older one up to date, however long that takes; ended anywhere, it
/// begins anew. Who opens it meanwhile, waits. A PostgreSQL that is away when a station
/// opens it is tried again whenever something is recorded.
[[nodiscard]] Result<std::unique_ptr<Archive>, std::string> open_archive(const ArchivePlace& place,
                                                                         ArchiveUse use);

struct Repaired {
  std::uint64_t rows = 0;         ///< kept
  std::uint64_t lost = 0;         ///< could not be read
  std::filesystem::path damaged;  ///< the old file, never removed
  /// Tables of which so much is damaged that the number of lost rows is not known.
  std::vector<std::string> incomplete = {};
  bool completed = false;  ///< an earlier repair was interrupted, and is complete now; nothing was counted
};
/// Copies all rows that can be read into a new file, which takes the place of the damaged one. May be ended
/// anywhere: the damaged file is in its place, or the next repair completes this one. After any error that is
/// not damage (disk full), or when no packet can be read, the damaged file is in its place. Of an SQLite
/// file.
[[nodiscard]] Result<Repaired, std::string> repair_archive(const std::filesystem::path& file);

}  // namespace srfs::ground
