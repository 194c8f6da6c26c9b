flexcomp-controller --robot tx60l.yaml --store can_slots.bin --can vcan0:1 &
sleep 2
flexcomp push --to can:vcan0:1 found.yaml
flexcomp probe --at can:vcan0:1 --targets work.csv -o answers.csv
kill $!
