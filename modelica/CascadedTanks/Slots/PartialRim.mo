within CascadedTanks.Slots;
partial model PartialRim "Slot: what leaves a tank elsewhere than through its outlet"
  input Real h(unit="V") "Level";
  input Real surplus(unit="V/s") "What flows in beyond what the outlet lets out";
  output Real leaves(unit="V/s") "Flow that leaves";
  output Real caught(unit="V/s") "Part of it that falls into the tank below";
end PartialRim;
