within CascadedTanks.Slots;
partial model PartialOutlet "Slot: what leaves a tank through its outlet"
  input Real nominal(unit="V/s") "Flow by Torricelli's law";
  input Real h(unit="V") "Level";
  input Real k(unit="V/s") "Flow at a level of 1 V";
  output Real actual(unit="V/s") "Flow that leaves";
end PartialOutlet;
