within CascadedTanks.Slots;
partial model PartialTank "Slot: how a level follows from what flows in and out"
  input Real nominal(unit="V/s") "Rate of the level in a tank with upright walls";
  input Real h(unit="V") "Level";
  output Real actual(unit="V/s") "Rate of the level";
end PartialTank;
