// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace srfs::ground {

/// Step n makes schema n + 1 of schema n. Times are nanoseconds since 1970 UTC. A step that has been released
/// is never changed.
inline constexpr std::array archive_steps{R"sql(
CREATE TABLE packets(
  id INTEGER PRIMARY KEY,        -- in the order of their coming
  time INTEGER NOT NULL,         -- of the spacecraft
  received INTEGER NOT NULL,
  apid INTEGER NOT NULL,
  sequence INTEGER NOT NULL,
  service INTEGER NOT NULL,
  subtype INTEGER NOT NULL,
  structure INTEGER,             -- number of the structure (3,25) or of the event (5,x)
  copies INTEGER NOT NULL,       -- 1: came live, 2: retrieved, 3: both
  crc INTEGER NOT NULL,          -- of raw
  raw BLOB NOT NULL);            -- the Space Packet
CREATE UNIQUE INDEX packet_once ON packets(apid, sequence, time, crc);
CREATE INDEX packet_structure ON packets(service, structure, time);
CREATE INDEX packet_time ON packets(time);
CREATE TABLE telecommands(
  id INTEGER PRIMARY KEY,
  token TEXT NOT NULL UNIQUE,
  request INTEGER NOT NULL,      -- packet identification and sequence control
  sent INTEGER NOT NULL,
  who TEXT NOT NULL,
  name TEXT NOT NULL,
  arguments TEXT NOT NULL,       -- JSON
  ad INTEGER NOT NULL,
  scheduled INTEGER NOT NULL);
CREATE INDEX telecommand_request ON telecommands(request, id);
CREATE INDEX telecommand_sent ON telecommands(sent);
CREATE TABLE reports(telecommand INTEGER NOT NULL, packet INTEGER NOT NULL,
  PRIMARY KEY(telecommand, packet)) WITHOUT ROWID;
CREATE TABLE files(id INTEGER PRIMARY KEY, time INTEGER NOT NULL, txn TEXT NOT NULL, direction TEXT NOT NULL,
  name TEXT NOT NULL, event TEXT NOT NULL, octets INTEGER);
CREATE TABLE passes(id INTEGER PRIMARY KEY, began INTEGER NOT NULL, ended INTEGER NOT NULL,
  packets INTEGER NOT NULL);
CREATE TABLE gaps(id INTEGER PRIMARY KEY, apid INTEGER NOT NULL, first INTEGER NOT NULL, count INTEGER,
  begin INTEGER NOT NULL, end INTEGER NOT NULL, missing INTEGER NOT NULL, attempts INTEGER NOT NULL,
  state INTEGER NOT NULL);       -- 0 open, 1 filled, 2 given up
CREATE INDEX gap_state ON gaps(state, apid);
CREATE TABLE sequences(apid INTEGER PRIMARY KEY, sequence INTEGER NOT NULL, time INTEGER NOT NULL);
CREATE TABLE parameters(id INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE);
CREATE TABLE minutes(parameter INTEGER NOT NULL, minute INTEGER NOT NULL, count INTEGER NOT NULL,
  min REAL NOT NULL, mean REAL NOT NULL, max REAL NOT NULL, worst INTEGER NOT NULL,
  PRIMARY KEY(parameter, minute)) WITHOUT ROWID;
CREATE TABLE dirty(minute INTEGER NOT NULL, structure INTEGER NOT NULL,
  PRIMARY KEY(minute, structure)) WITHOUT ROWID;
)sql",
                                          R"sql(
CREATE TABLE pruned(one INTEGER PRIMARY KEY CHECK(one=1),
  minute INTEGER NOT NULL);      -- of earlier ones, packets were removed: their aggregates stay as they are
DROP INDEX gap_state;
CREATE INDEX gap_state ON gaps(state, apid, end);
CREATE INDEX packet_latest ON packets(service, structure);
)sql",
                                          R"sql(
CREATE TABLE acknowledgements(packet INTEGER PRIMARY KEY, time INTEGER NOT NULL, who TEXT NOT NULL);
)sql"};

}  // namespace srfs::ground
