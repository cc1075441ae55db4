#include "server/store/sqlite.h"

#include <cerrno>

#include "server/store/job_record.h"

namespace remesh::sqlite {
namespace {

bool is_full(int code, sqlite3* handle) {
    // Of a COMMIT that failed SQLite doesn't tell the system's error, which then is the last one.
    const int told = sqlite3_system_errno(handle);
    const int error = told != 0 ? told : errno;
    return code == SQLITE_FULL || ((code & 0xff) == SQLITE_IOERR &&
                                   (error == ENOSPC || error == EDQUOT || error == EFBIG));
}

void check(int code, sqlite3* handle, const char* what) {
    if (code != SQLITE_OK) {
        throw StoreError(std::string("store: ") + what + ": " + sqlite3_errmsg(handle),
                         is_full(code, handle) ? StoreError::Kind::Full : StoreError::Kind::Failed);
    }
}

}  // namespace

Connection::Connection(const std::string& path, Mode mode) {
    sqlite3* handle = nullptr;
    const int flags =
        mode == Mode::ReadOnly ? SQLITE_OPEN_READONLY : SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE;
    const int code = sqlite3_open_v2(path.c_str(), &handle, flags | SQLITE_OPEN_NOMUTEX, nullptr);
    handle_.reset(handle);
    check(code, handle, "can't open the database");
    sqlite3_extended_result_codes(handle, 1);
    // Several processes write; each holds the lock for one short transaction.
    sqlite3_busy_timeout(handle, 10'000);
}

std::int64_t Connection::integer(std::string_view sql) {
    Statement statement(*this, sql);
    return statement.next() ? statement.integer(0) : 0;
}

void Connection::execute(const char* sql) {
    check(sqlite3_exec(handle(), sql, nullptr, nullptr, nullptr), handle(), "can't execute");
}

std::int64_t Connection::changes() const {
    return sqlite3_changes64(handle());
}

std::int64_t Connection::last_row_id() const {
    return sqlite3_last_insert_rowid(handle());
}

Statement::Statement(Connection& connection, std::string_view sql) : connection_(connection) {
    sqlite3_stmt* statement = nullptr;
    const int code = sqlite3_prepare_v2(connection.handle(), sql.data(),
                                        static_cast<int>(sql.size()), &statement, nullptr);
    statement_.reset(statement);
    check(code, connection.handle(), "can't prepare");
}

Statement& Statement::bind(std::int64_t value) {
    check(sqlite3_bind_int64(statement_.get(), ++bound_, value), connection_.handle(),
          "can't bind");
    return *this;
}

// Bytes aren't copied: every caller keeps them until the statement is done.
Statement& Statement::bind(std::string_view text) {
    check(sqlite3_bind_text64(statement_.get(), ++bound_, text.data() ? text.data() : "",
                              text.size(), SQLITE_STATIC, SQLITE_UTF8),
          connection_.handle(), "can't bind");
    return *this;
}

Statement& Statement::bind_blob(std::string_view bytes) {
    check(sqlite3_bind_blob64(statement_.get(), ++bound_, bytes.data() ? bytes.data() : "",
                              bytes.size(), SQLITE_STATIC),
          connection_.handle(), "can't bind");
    return *this;
}

Statement& Statement::bind_null() {
    check(sqlite3_bind_null(statement_.get(), ++bound_), connection_.handle(), "can't bind");
    return *this;
}

Statement& Statement::bind(const std::optional<std::int64_t>& value) {
    return value ? bind(*value) : bind_null();
}

bool Statement::next() {
    const int code = sqlite3_step(statement_.get());
    if (code == SQLITE_ROW) {
        return true;
    }
    if (code != SQLITE_DONE) {
        check(code, connection_.handle(), "can't execute");
    }
    return false;
}

void Statement::run() {
    while (next()) {
    }
}

std::int64_t Statement::integer(int column) const {
    return sqlite3_column_int64(statement_.get(), column);
}

std::optional<std::int64_t> Statement::maybe_integer(int column) const {
    if (sqlite3_column_type(statement_.get(), column) == SQLITE_NULL) {
        return std::nullopt;
    }
    return integer(column);
}

std::string Statement::text(int column) const {
    const void* bytes = sqlite3_column_blob(statement_.get(), column);
    const int size = sqlite3_column_bytes(statement_.get(), column);
    return bytes ? std::string(static_cast<const char*>(bytes), static_cast<std::size_t>(size))
                 : std::string();
}

Transaction::Transaction(Connection& connection) : connection_(connection) {
    connection_.execute("BEGIN IMMEDIATE");
}

Transaction::~Transaction() {
    if (!done_) {
        sqlite3_exec(connection_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
    }
}

void Transaction::commit() {
    connection_.execute("COMMIT");
    done_ = true;
}

}  // namespace remesh::sqlite
