# shellcheck shell=bash
# What boards/NAME/board.toml says, for shell scripts: `. boards/facts.sh`
boards_folder=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)

# Names of all boards.
boards() {
    local file
    for file in "$boards_folder"/*/board.toml; do basename "$(dirname "$file")"; done
}

# fact NAME KEY: the value of a key.
fact() {
    local file=$boards_folder/$1/board.toml value
    if ! [ -f "$file" ]; then
        echo "no board $1, expected one of: $(boards | tr '\n' ' ')" >&2
        return 1
    fi
    value=$(sed -n -e "s/^$2 = \"\(.*\)\"\$/\1/p" -e "s/^$2 = \([0-9_]*\)\$/\1/p" "$file")
    if [ -z "$value" ]; then
        echo "boards/$1/board.toml: missing key $2" >&2
        return 1
    fi
    echo "$value"
}

# elf NAME: where build.sh and run.sh put the firmware.
elf() {
    local target
    target=$(fact "$1" target) && echo "$boards_folder/target/$target/release/$1"
}

# Compiler flags with which an ELF has the same bytes wherever sources and registry lie: the place of a panic is a path.
same_bytes() {
    local registry=${CARGO_HOME:-$HOME/.cargo}
    printf '%s\x1f%s' "--remap-path-prefix=$(dirname "$boards_folder")=/nirspi" "--remap-path-prefix=$registry=/cargo"
}
