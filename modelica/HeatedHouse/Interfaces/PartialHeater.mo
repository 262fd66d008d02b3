within HeatedHouse.Interfaces;
partial model PartialHeater "Slot: from the power of the heaters to the heat that the air receives"
  input Real power(unit="W") "Of the heaters";
  input Real T(unit="K") "Temperature of the air";
  output Real heat(unit="W") "That the air receives";
end PartialHeater;
