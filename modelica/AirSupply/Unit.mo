within AirSupply;
model Unit "Reservoir that a compressor fills while it runs; nothing else takes or gives air"
  parameter Real V(unit="m3", min=0.01) = 0.4 "Volume of the reservoir";
  parameter Real delivery(unit="kg/s", min=1e-4, max=0.1) = 0.01 "Mass flow rate of the compressor";
  parameter Real T(unit="K", min=200.0) = 293.15 "Temperature of the reservoir";
  parameter Real p0(unit="Pa") = 101325.0 "Pressure of the surroundings";
  final parameter Real R(unit="J/(kg.K)") = 287.05 "Gas constant of air";
  input Real COMP(unit="1") "1 while the intake of the compressor is closed, 0 while it delivers";
  input Real dloss(unit="kg/s") "Correction of loss";
  parameter Real loss(unit="kg/s") = 0.0 "Mass flow rate that is taken";
  output Real reservoir(unit="Pa", start=9e5, fixed=true, nominal=1e6) "Pressure of the reservoir, above p0";
  output Real reservoirReading(unit="Pa") = sensor.y "Reading of that pressure";
  output Real lost(unit="kg/s") = loss + dloss + leak.q "Mass flow rate out of the reservoir";

  replaceable Common.Signals.Unchanged running(u=1.0 - COMP)
    constrainedby Common.Interfaces.Signal(u=1.0 - COMP) "From the valve of the intake to delivery";
  replaceable Slots.Delivery compressor(
    nominal=delivery*running.y, p=reservoir + p0, runs=1.0 - COMP)
    constrainedby Slots.PartialDelivery(
    nominal=delivery*running.y, p=reservoir + p0, runs=1.0 - COMP) "Compressor";
  replaceable Common.Leaks.Tight leak(p1=reservoir + p0, p2=p0)
    constrainedby Common.Interfaces.Flow(p1=reservoir + p0, p2=p0) "Leaks and consumers";
  replaceable Slots.Reservoir air(
    isothermal=R*T/V*(compressor.actual - loss - dloss - leak.q), p=reservoir + p0)
    constrainedby Slots.PartialReservoir(
    isothermal=R*T/V*(compressor.actual - loss - dloss - leak.q), p=reservoir + p0)
    "Air in the reservoir";
  replaceable Common.Signals.Unchanged sensor(u=reservoir)
    constrainedby Common.Interfaces.Signal(u=reservoir) "Sensor of the pressure";
equation
  der(reservoir) = air.actual;
  annotation (
    experiment(StopTime=2000.0, Tolerance=1e-6),
    Documentation(info="<html>
<p><code>V*p' = R*T*(delivery*runs - leak)</code>. Of the volume only the ratio of flows to it shows in
a pressure: <code>V</code> is a usual one, and flows are as sure as it is.</p>
</html>"));
end Unit;
