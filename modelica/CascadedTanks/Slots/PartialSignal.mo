within CascadedTanks.Slots;
partial model PartialSignal "Slot: from a voltage to the one that acts, or is read"
  input Real u(unit="V") "Nominal or true value";
  output Real y(unit="V") "Value that acts or is read";
end PartialSignal;
