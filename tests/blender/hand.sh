#!/usr/bin/env bash
# hand.sh FOLDER COMMAND...: runs the command, and meanwhile every script that it leaves as FOLDER/todo.
# A Blender that has another system's folders has no xdotool, nor anything that takes pictures.
folder=$1
shift
rm -f "$folder/todo"
"$@" &
while kill -0 $! 2>/dev/null; do
  if [ -f "$folder/todo" ]; then
    bash "$folder/todo" || echo "hand.sh: $(cat "$folder/todo")" >&2
    rm "$folder/todo"
  fi
  sleep 0.05
done
wait $!
