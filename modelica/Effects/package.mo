package Effects "Common laws of what machines do beside their nominal models"
  annotation (
    version="1.0",
    Documentation(info="<html>
<p>Laws of friction, of leaks and of signals, for any library. A library that says
<code>annotation(uses(Effects(version=&quot;1.0&quot;)))</code> may constrain its slots by the partial
models in <code>Interfaces</code>, and extend a law to an effect of its own machine:</p>
<pre>
package Stage
  import Common = Effects;

  model BearingFriction \"dry friction in the bearing\"
    extends Common.Friction.Dry(coulomb(max=5.0));
    annotation (__Workbench(effect(
      size=\"coulomb\", matters=0.2, separation=\"a slow run-down\")));
  end BearingFriction;

  annotation (uses(Effects(version=\"1.0\")));
end Stage;
</pre>
<p>What a small change is, what matters, and within which bounds, depends on the machine: such things
stand in the extending class alone. The import gives the library another name, which a package
<code>Effects</code> of the extending library does not hide.</p>
<h4>Form</h4>
<p>Each law has a size that is zero by default: then it has no effect at all, exactly. No law has
events: where the textbook has a jump, there is a slope over a stated width; where it has a kink, it
stands in <code>noEvent</code> or is rounded. A solver with step control passes both without
chatter. Units are SI; what may be of several kinds, as the value of a signal, has none, and gets one
by a modifier: <code>Common.Signals.Offset(offset(unit=&quot;V&quot;))</code>.</p>
</html>"));
end Effects;
