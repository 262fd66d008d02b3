within HeatedHouse.Interfaces;
partial model PartialShell "Slot: what leaves the air through walls, floor and roof"
  input Real nominal(unit="W") "In proportion to the difference of temperatures";
  input Real T(unit="K") "Temperature of the air";
  input Real G(unit="W/K") "Conductance from the air to the outside";
  output Real actual(unit="W") "Heat that leaves the air";
end PartialShell;
