within LeakingChamber.Effects;
model CompressibleLaminarLeak "long narrow gaps, in which air expands on its way"
  extends Common.Leaks.CompressibleLaminar(conductance(max=1e-7));
  annotation (
    __Workbench(effect(
      size="conductance", matters=6e-15,
      separation="the flow at several pressures that are kept")),
    Documentation(info="<html>
<p>The conductance is that at a mean pressure of 1 bar; at 7 bar above the room it is 4.5 times as
much.</p>
</html>"));
end CompressibleLaminarLeak;
