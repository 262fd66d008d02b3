within ServoPendulum.Tests;
model CurrentMeetsItsResistance "Voltage, resistance and current of a blocked motor"
  Drive.SupplyResistance supply(u=4.0, duty=-0.5, current=1.0, RS=2.0);
  Drive.WindingHeating winding(u=4.0, duty=1.0, current=1.5, rise=0.01, tau=5.0);
  Drive.BridgeDrop bridge(u=-6.0, zone=0.5);
  Drive.BridgeDrop below(u=0.3, zone=0.5);
  Drive.CurrentLimit current(u=2.0, share=0.25, high=1.0);
equation
  assert(abs(supply.y - 4.5) < 1e-12, "The supply is not seen through the square of the duty");
  // 9 W into the winding, of which a first-order loss leaves 45*(1 - exp(-t/5)) joules.
  assert(abs(winding.y - 4.0*(1.0 + 0.45*(1.0 - exp(-time/5.0)))) < 1e-5, "Heat of the winding");
  assert(abs(bridge.y + 5.5) < 1e-3 and abs(below.y) < 1e-3, "The bridge does not lose 0.5 V");
  assert(abs(current.y - 1.75) < 1e-3, "A quarter of what exceeds the limit is not lost");
  annotation (experiment(StopTime=6.0, Tolerance=1e-8));
end CurrentMeetsItsResistance;
