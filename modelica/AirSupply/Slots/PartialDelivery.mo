within AirSupply.Slots;
partial model PartialDelivery "Slot: what the compressor delivers"
  input Real nominal(unit="kg/s") "Mass flow rate at any back pressure";
  input Real p(unit="Pa") "Back pressure, absolute";
  input Real runs(unit="1") "1 while the compressor runs, else 0";
  output Real actual(unit="kg/s") "Mass flow rate";
end PartialDelivery;
