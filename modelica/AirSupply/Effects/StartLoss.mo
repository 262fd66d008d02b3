within AirSupply.Effects;
model StartLoss "a compressor that delivers late at each start"
  extends Common.Interfaces.Signal;
  parameter Real loss(unit="s", min=0.0, max=15.0) = 0.0 "Delivery that is missing at a start, as a time";
  final parameter Real tau(unit="s") = 10.0 "Time constant";
  Real begun(unit="1", start=0.0, fixed=true) "1 - exp(-t/tau)";
protected
  final parameter Real empties(unit="s") = 20.0 "Time in which pipes empty after a stop";
equation
  der(begun) = u*(1.0 - begun)/tau - (1.0 - u)*begun/empties;
  y = u*(1.0 - loss/tau*(1.0 - begun));
  annotation (
    __Workbench(effect(
      size="loss", matters=1.0,
      slots={"running"},
      separation="pressure at its outlet, sampled ten times as often")),
    Documentation(info="<html>
<p>Full delivery is reached with the time constant <code>tau</code>; what is missing of it is <code>loss</code>
seconds. <code>y = u*(1 - loss/tau*exp(-t/tau))</code>, t since the start: pipes and dryer are filled first. A
start that is reported too early looks the same.</p>
</html>"));
end StartLoss;
